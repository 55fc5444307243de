// Closest points against brute force over all triangles, in double precision.
#include <oneapi/tbb/parallel_for.h>

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <map>

#include "collider/field.h"
#include "demos/shared/shapes.h"
#include "sdf/build.h"
#include "sdf/mesh_io.h"
#include "tests/support/analytic.h"
#include "tests/support/support.h"
#include "tests/support/truth.h"

using namespace bilayer;
using namespace bilayer::test;

namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr double halfWidth = 3;         // of the bands here [voxels]
constexpr double tolerance = 1e-5;      // of distances in the band [voxels]
constexpr double farTolerance = 1e-6;   // of distances beyond it, of their own

// A mesh and its field.
struct Case {
    std::string name;
    Mesh mesh;
    float resolution;
};

// The distances of a point to the features of a triangle, by their definition.
struct Features {
    double face;                   // infinite beside it
    std::array<double, 3> edges;   // infinite beside them
    std::array<double, 3> corners;
};

}  // namespace
