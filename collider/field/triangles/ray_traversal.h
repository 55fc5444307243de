// SPDX-License-Identifier: Apache-2.0
// The traversal of a mesh's tree along a ray, nearest nodes first. SIMD tests in single precision reject triangles
// conservatively. Highway includes this file once for each instruction set: only between HWY_BEFORE_NAMESPACE's headers
// and its own, after hwy/highway.h.
// Tested by tests/collider/mesh_rays.cpp through firstHit().
#if defined(BILAYER_COLLIDER_RAY_TRAVERSAL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef BILAYER_COLLIDER_RAY_TRAVERSAL_H
#undef BILAYER_COLLIDER_RAY_TRAVERSAL_H
#else
#define BILAYER_COLLIDER_RAY_TRAVERSAL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "collider/field/layout/path.h"
#include "collider/field/triangles/mesh_tree.h"
#include "collider/field/triangles/tree_place.h"
#include "sdf/bvh/ray_slabs.h"

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace {

// The traversal of one tree along one path.
class RayTraversal {
  public:
    RayTraversal(const MeshTree& mesh, const Path& path)
        : tree_(mesh.tree()),
          place_(mesh, path.origin),
          direction_(path.direction),
          slabs_(place_.point, direction_, place_.slack),
          perMetre_(1 / double(mesh.voxelSize())) {
        limitTo(path.length);
    }

    // Ignores triangles farther along the path [m].
    void limitTo(double along) {
        limit_ = std::min(float(along * perMetre_) * quotientRoundUp + place_.slack, std::numeric_limits<float>::max());
    }

    // Calls visit(triangle) for each triangle that the path may meet. A long triangle may be visited several times.
    template <class Visit>
    void run(Visit visit) {
        descend(
            tree_, tree_.root(), [&](float key) { return key > limit_; },
            [&](std::uint32_t group, NodeStack& stack) { slabs_.pushMet(tree_.groups[group], limit_, stack); },
            [&](std::uint32_t leaf) { return visitLeaf(tree_.leaves[leaf], visit), false; });
    }

  private:
    // A bit mask of the triangles that the line passes, each in its own frame. All terms are multiplied by the cosine
    // between line and normal. Distances in the plane thereby become distances from the line, at any angle.
    unsigned passed(const WideLeaf& leaf, std::size_t i) const {
        const Tag tag;
        const auto load = [&](const float* from) { return hn::Load(tag, from + i); };
        const auto dot = [&](const Vec* a, const Vec* b) {
            return hn::Add(hn::Add(hn::Mul(a[0], b[0]), hn::Mul(a[1], b[1])), hn::Mul(a[2], b[2]));
        };
        const auto det = [&](Vec a, Vec b, Vec c, Vec d) { return hn::Sub(hn::Mul(a, d), hn::Mul(b, c)); };
        Vec q[3], d[3], n[3], a[3];
        for (int k = 0; k < 3; ++k) {
            q[k] = place_.from(leaf, load, k);
            d[k] = hn::Set(tag, direction_[k]);
            n[k] = load(leaf.normal[k]);
            a[k] = load(leaf.along[k]);
        }
        const Vec b[3] = {det(n[1], n[2], a[1], a[2]), det(n[2], n[0], a[2], a[0]), det(n[0], n[1], a[0], a[1])};
        const Vec height = dot(q, n), fall = dot(d, n), steep = hn::Abs(fall);
        const auto upright = [&](Vec v) { return hn::Xor(v, hn::And(fall, hn::SignBit(tag))); };
        const Vec x = upright(det(dot(q, a), dot(d, a), height, fall));
        const Vec y = upright(det(dot(q, b), dot(d, b), height, fall)), along = upright(hn::Neg(height));

        const Vec bcx = load(leaf.directionBC[0]), bcy = load(leaf.directionBC[1]);
        const Vec acrossBC = det(bcx, bcy, hn::Sub(x, hn::Mul(load(leaf.lengthAB), steep)), y);
        const Vec acrossAC = det(x, y, load(leaf.directionAC[0]), load(leaf.directionAC[1]));
        // the sum of the coordinates is an upper bound of the distance
        const Vec away = hn::Add(hn::Add(hn::Abs(q[0]), hn::Abs(q[1])), hn::Abs(q[2]));
        const Vec margin = hn::Add(hn::Mul(hn::Set(tag, passRounding), away), hn::Set(tag, passTolerance));
        const Vec inside = hn::Min(hn::Min(y, along), hn::Min(acrossBC, acrossAC));
        return bitsOf(hn::And(hn::Ge(hn::Add(inside, margin), hn::Zero(tag)),
                              hn::Le(along, hn::Add(hn::Mul(hn::Set(tag, limit_), steep), margin))));
    }

    template <class Visit>
    void visitLeaf(const WideLeaf& leaf, Visit& visit) const {
        unsigned bits = 0;
        for (std::size_t i = 0; i < treeWidth; i += hn::Lanes(Tag())) bits |= passed(leaf, i) << i;
        for (; bits != 0; bits &= bits - 1) visit(leaf.triangles[std::countr_zero(bits)]);
    }

    const WideTree& tree_;
    TreePlace place_;
    glm::vec3 direction_;
    RaySlabs slabs_;
    double perMetre_;
    float limit_ = 0;
};

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
