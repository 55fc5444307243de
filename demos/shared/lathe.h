// SPDX-License-Identifier: Apache-2.0
// Surfaces around an axis, for meshes of machine parts: rows of vertices, curves around z, and a lathe that joins them.
#pragma once

#include <functional>
#include <glm/gtc/constants.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/mesh.h>

namespace bilayer::shapes::detail {

inline constexpr double pi = glm::pi<double>();

/// Vertices of the smallest ring around an apex, so that its triangles are equilateral.
inline constexpr int minAround = 6;

/// Throws std::invalid_argument with this text unless a condition is met.
void require(bool met, const char* what);

/// Throws unless a count of edges per circle puts vertices on the corners of hexagons and squares.
void requireSegments(int segments);

/// The count of edges of about a given length that a length is divided into.
int cellsOf(double length, double edge);

glm::vec3 aroundAxis(double radius, double angle, double height);

/// A vertex in a row, with its position in the row as the key.
struct Link {
    unsigned vertex;
    double key;
};
using Row = std::vector<Link>;

/// Returns the index of the new point.
unsigned addPoint(Mesh& mesh, const glm::vec3& point);

/// Fills the space between two rows of ascending keys with triangles, always advancing to the lower key; `b` is to the
/// left of `a`. On equal keys, `b` advances first. The diagonals on the curved flanks of a thread then cut into the
/// flanks and never add material.
void zip(Mesh& mesh, const Row& a, const Row& b);

/// Radius as a function of the angle.
using Outline = std::function<double(double)>;

Outline round(double radius);

/// Returns a circle whose `segments` chords stay outside of the radius.
Outline roundHole(double radius, int segments);

/// Returns a regular polygon; one of its sides faces +x.
Outline polygon(int sides, double apothem);

/// A closed curve around z.
struct Level {
    Outline radius;
    double height;
    int count;  ///< count of vertices; 1: an apex

    /// Returns the length of its edges.
    double edge() const { return 2 * pi * radius(0) / count; }
};

/// A single vertex on the axis.
Level apex(double height);

/// Builds a surface around z, curve by curve: outward on bottom faces, up on outer walls, inward on top faces, down in
/// holes.
class Lathe {
  public:
    explicit Lathe(Mesh& mesh) : mesh_(mesh) {}

    /// Starts at a curve without joining it to anything.
    const Row& begin(const Level& level);
    const Row& begin(const Level& level, const Row& row);

    /// Continues to a curve, through intermediate ones. The last row is `last` if given.
    const Row& to(const Level& level, const Row* last = nullptr);

  private:
    // The row starts at the same angle as the previous one.
    Row addRow(const Level& level);

    Mesh& mesh_;
    Level level_{};
    Row row_;
};

}  // namespace bilayer::shapes::detail
