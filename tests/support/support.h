// SPDX-License-Identifier: Apache-2.0
// Utilities of all tests: the public corpus of meshes, a scratch folder, brute-force distances.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::test {

/// A mesh of the public corpus. If the corpus is absent, returns nothing and prints that the test is skipped. The
/// environment variable BILAYER_MESHES overrides the corpus folder known at compile time.
std::optional<std::filesystem::path> corpusMesh(const std::string& name);

/// A path in an empty folder of this process, removed at exit. The folder is created in BILAYER_SCRATCH if that is set.
std::filesystem::path scratch(const std::string& name);

/// The bytes of a file; none if it cannot be read.
std::string contentsOf(const std::filesystem::path& path);

/// A random seed: from the environment variable BILAYER_SEED, which ./run test sets, else from the clock. CAPTURE(seed)
/// prints it with every failure.
unsigned seed();

/// Whether the address or the thread sanitizer, of any compiler, replaces this program's malloc. It keeps freed memory,
/// ends a program that requests too much, takes terabytes of address space, and does not prepare its locks for a fork.
bool isSanitized();

/// The squared distance from a point to a triangle in double precision, by the Voronoi regions of its features in the
/// plane. Independent of the library's own code.
double squaredDistance(const glm::dvec3& point, const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c);

/// The distance from a point to a mesh, over all its triangles.
double distance(const Mesh& mesh, const glm::dvec3& point);

/// The generalized winding number of a point: near 1 inside a closed, outward mesh, near 0 outside.
double windingNumber(const Mesh& mesh, const glm::dvec3& point);

/// distance(), negated where the winding number exceeds 0.5.
double signedDistance(const Mesh& mesh, const glm::dvec3& point);

}  // namespace bilayer::test
