// SPDX-License-Identifier: Apache-2.0
#include "sdf/mesh/orient.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <span>
#include <utility>
#include <vector>

#include "sdf/bvh/triangle_tree.h"
#include "sdf/mesh/consistent_triangles.h"
#include "sdf/mesh/oriented_components.h"
#include "sdf/mesh/part_nesting.h"
#include "sdf/mesh/side_classification.h"

namespace bilayer::detail {
namespace {

/// Count of sample points for the test whether an open component with negative volume bounds a solid as it is. Few
/// points suffice to recognise a majority.
constexpr std::size_t samplesOfComponent = 32;
/// Each pass resolves one level of nested uncertain open components. More than a few passes are not worth the time.
constexpr int maxPasses = 8;

// Sums over the components around a component.
struct Surroundings {
    int winding = 0, untrusted = 0;

    explicit Surroundings(int value) : winding(value), untrusted(value) {}
    Surroundings(const OrientedComponent& outer)
        : winding(outer.volume > 0 ? 1 : -1), untrusted(outer.mixed || outer.flipped) {}
    Surroundings& operator+=(const Surroundings& o) {
        winding += o.winding;
        untrusted += o.untrusted;
        return *this;
    }
    Surroundings& operator-=(const Surroundings& o) {
        winding -= o.winding;
        untrusted -= o.untrusted;
        return *this;
    }
};

bool isInsideOut(const OrientedComponent& own, const Surroundings& around) {
    const bool trusted = !own.mixed && around.untrusted == 0;
    return around.winding <= 0 ? own.volume < 0 : !trusted && own.volume > 0;
}

// An open component may be the wall of a bore, with the solid on the other side. The rest of the mesh then decides.
bool boundsSolid(const OrientedComponent& component, const Sides& sides) {
    return !component.closed() && !component.mixed &&
           sides.measure(component.triangles, samplesOfComponent).solid > 0.5;
}

// Flips components from the outermost inward. The box of a component lies within the boxes of those around it.
void flipInsideOut(const Mesh& mesh, const ConsistentTriangles& consistent, OrientedComponents& components,
                   Progress* progress) {
    const std::span<const OrientedComponent> all = components.all();
    std::vector<unsigned> partOf(mesh.triangles.size(), noPart);
    bool some = false;
    for (unsigned c = 0; c < all.size(); ++c) {
        if (!all[c].bounding()) continue;
        some = true;
        for (const unsigned i : all[c].triangles)
            if (consistent.encloses(i)) partOf[i] = c;
    }
    if (!some) return;
    const TriangleTree tree(mesh, progress);
    const PartNesting nesting(mesh, tree, partOf, all.size(), progress);
    const Sides sides(mesh, tree, progress);
    std::vector<Surroundings> inherited(all.size(), Surroundings(0));
    for (const unsigned c : nesting.largestFirst()) {
        const Surroundings around = nesting.sum(c, inherited, [&](unsigned outer) { return Surroundings(all[outer]); });
        if (all[c].bounding() && isInsideOut(all[c], around) && !boundsSolid(all[c], sides)) components.flip(c);
    }
}

Orientation orientOnce(const Mesh& mesh, Progress* progress) {
    ConsistentTriangles consistent(mesh, progress);
    OrientedComponents components(mesh, consistent);
    flipInsideOut(mesh, consistent, components, progress);
    Orientation orientation;
    orientation.mesh.points = mesh.points;
    orientation.mesh.origin = mesh.origin;
    poll(progress);
    orientation.mesh.triangles = mesh.triangles;
    for (const unsigned i : consistent.eachTriangle()) {
        if (!components.isFlipped(i)) continue;
        std::swap(orientation.mesh.triangles[i].y, orientation.mesh.triangles[i].z);
        ++orientation.flippedTriangles;
    }
    for (const OrientedComponent& component : components.all()) {
        orientation.mixedComponents += component.mixed;
        orientation.flippedComponents += component.flipped && !component.mixed;
        if (component.oneSided && !component.twoSided) orientation.oneSidedTriangles += component.triangles.size();
    }
    return orientation;
}

std::size_t countDifferent(const Mesh& a, const Mesh& b) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < a.triangles.size(); ++i) count += a.triangles[i] != b.triangles[i];
    return count;
}

}  // namespace

Orientation orient(const Mesh& mesh, Progress* progress) {
    validate(mesh);
    Orientation all = orientOnce(mesh, progress);
    // open components are judged by their surroundings, which the previous pass may have flipped
    for (int pass = 1; pass < maxPasses && all.flippedTriangles > 0; ++pass) {
        const Orientation next = orientOnce(all.mesh, progress);
        if (next.flippedTriangles == 0) break;
        all.mesh = next.mesh;
        all.flippedComponents += next.flippedComponents;
    }
    all.flippedTriangles = countDifferent(mesh, all.mesh);
    return all;
}

}  // namespace bilayer::detail
