// What all tests share: the public corpus of meshes, a scratch folder, distances by brute force.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::test {

/// A mesh of the public corpus, or nothing where the corpus is absent; then a message says that the test is skipped.
/// The environment variable BILAYER_MESHES names the corpus' folder where it is not where it was at compile time.
std::optional<std::filesystem::path> corpusMesh(const std::string& name);

/// A path in an empty folder of this process's own, removed at exit; within BILAYER_SCRATCH, likewise.
std::filesystem::path scratch(const std::string& name);

/// A random seed: from the environment variable BILAYER_SEED, which ./run test sets, else from the clock. Printed with
/// every failure by CAPTURE(seed).
unsigned seed();

/// The squared distance from a point to a triangle in double precision, by the regions of the plane that the closest
/// feature divides (independent of the library's own code).
double squaredDistance(const glm::dvec3& point, const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c);

/// The distance from a point to a mesh, over all its triangles.
double distance(const Mesh& mesh, const glm::dvec3& point);

/// The generalized winding number of a point: near 1 inside a closed, outward mesh, near 0 outside.
double windingNumber(const Mesh& mesh, const glm::dvec3& point);

/// distance(), negative where the winding number is above a half.
double signedDistance(const Mesh& mesh, const glm::dvec3& point);

}  // namespace bilayer::test
