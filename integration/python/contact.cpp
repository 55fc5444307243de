// SPDX-License-Identifier: Apache-2.0
// collide() and distance() of two posed colliders.
#include <bilayer/collider/contact.h>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <memory>
#include <mutex>
#include <stdexcept>

#include <bilayer/collider/distance.h>

#include "integration/python/arguments.h"
#include "integration/python/arrays.h"
#include "integration/python/bindings.h"

namespace bilayer::python {
namespace {

constexpr std::size_t pairsPerTask = 4;  // a pair takes microseconds

// A contact cache that calls from several threads take in turn.
struct LockedCache {
    ContactCache cache;
    std::mutex mutex;
};

Motion motionOf(const py::object& object, const char* name) {
    if (object.is_none()) return {};
    const Floats motion(object, name, {2, 3});
    if (!motion.shape().empty())
        throw std::invalid_argument(
            fmt::format("{}: expected a displacement and a rotation vector, shape (2, 3), got {} of them", name,
                        text(motion.shape())));
    return {motion.points()[0], motion.points()[1]};
}

Placed placed(const Collider& collider, const py::object& pose, float scale, const py::object& motion,
              const char* name) {
    const std::string suffix = std::string("_") + name;
    requirePositive(double(scale), ("scale" + suffix).c_str());
    return {collider, poseOf(pose, ("pose" + suffix).c_str()), scale, motionOf(motion, ("motion" + suffix).c_str())};
}

py::object findContacts(const Collider& a, const py::object& poseA, const Collider& b, const py::object& poseB,
                        float margin, bool exact, float scaleA, float scaleB, const py::object& motionA,
                        const py::object& motionB, float minNormalCosine, float minNormalCosineApart,
                        bool keepsObliqueEdges, LockedCache* cache) {
    if (!(margin >= 0) || !std::isfinite(margin))
        throw std::invalid_argument(fmt::format("margin is {}, and must be 0 or above", margin));
    const Placed first = placed(a, poseA, scaleA, motionA, "a"), second = placed(b, poseB, scaleB, motionB, "b");
    const ContactOptions options{.margin = margin,
                                 .exact = exact,
                                 .minNormalCosine = minNormalCosine,
                                 .minNormalCosineApart = minNormalCosineApart,
                                 .keepsObliqueEdges = keepsObliqueEdges};
    std::vector<Contact> contacts;
    ContactReport report;
    {
        const py::gil_scoped_release release;
        std::unique_lock<std::mutex> lock;
        if (cache) lock = std::unique_lock(cache->mutex);
        report = collide(first, second, options, contacts, cache ? &cache->cache : nullptr);
    }
    const auto count = py::ssize_t(contacts.size());
    const Records<Contact> records(std::move(contacts), {count});
    return result("Contacts", records.member(&Contact::position), records.member(&Contact::normal),
                  records.member(&Contact::distance), records.member(&Contact::feature).attr("view")("uint32"),
                  records.member(&Contact::approach), records.member(&Contact::turningRadius), report.pointsTested,
                  report.beyondBand);
}

const char* nameOf(Overlap overlap) {
    switch (overlap) {
        case Overlap::none:
            return "none";
        case Overlap::surfaces:
            return "surfaces";
        case Overlap::aInsideB:
            return "a inside b";
        case Overlap::bInsideA:
            return "b inside a";
    }
    return "";
}

int indexOf(const WitnessPoint& point) {
    return point.triangle == noTriangle ? -1 : int(point.triangle);
}

DistanceOptions reachOf(float maxDistance) {
    if (!(maxDistance >= 0))
        throw std::invalid_argument(fmt::format("max_distance is {}, and must be 0 or above", maxDistance));
    return {maxDistance};
}

py::object findDistance(const Collider& a, const py::object& poseA, const Collider& b, const py::object& poseB,
                        float scaleA, float scaleB, float maxDistance) {
    const Placed first = placed(a, poseA, scaleA, py::none(), "a"), second = placed(b, poseB, scaleB, py::none(), "b");
    const DistanceOptions options = reachOf(maxDistance);
    BodyDistance answer;
    {
        const py::gil_scoped_release release;
        answer = distance(first, second, options);
    }
    return result("BodyDistance", answer.found, nameOf(answer.overlap), answer.distance, toArray(answer.a.position),
                  toArray(answer.b.position), toArray(answer.normal), indexOf(answer.a), indexOf(answer.b));
}

std::vector<const Collider*> collidersOf(const py::object& object, std::size_t count) {
    std::vector<const Collider*> colliders;
    if (py::isinstance<Collider>(object)) {
        colliders.assign(count, object.cast<const Collider*>());
        return colliders;
    }
    for (const py::handle& item : object) {
        if (!py::isinstance<Collider>(item))
            throw std::invalid_argument(fmt::format("colliders: expected a Collider or a sequence of them, got a '{}'",
                                                    Py_TYPE(item.ptr())->tp_name));
        colliders.push_back(item.cast<const Collider*>());
    }
    if (colliders.size() != count)
        throw std::invalid_argument(
            fmt::format("colliders: expected one for each of {} poses, got {}", count, colliders.size()));
    return colliders;
}

py::object findDistances(const py::object& colliders, const py::object& poses, const py::object& pairs,
                         float maxDistance) {
    std::vector<Pose> placements;
    for (const py::handle& pose : poses)
        placements.push_back(poseOf(py::reinterpret_borrow<py::object>(pose), "poses"));
    const py::object keeper = py::isinstance<Collider>(colliders) ? colliders : py::object(py::tuple(colliders));
    const std::vector<const Collider*> bodies = collidersOf(keeper, placements.size());
    const std::vector<std::uint32_t> of = indices(pairs, "pairs", 2, bodies.size(), "a body");
    const DistanceOptions options = reachOf(maxDistance);
    py::array_t<float> distances(py::ssize_t(of.size() / 2));
    float* const to = distances.mutable_data();
    {
        const py::gil_scoped_release release;
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, of.size() / 2, pairsPerTask), [&](const auto& range) {
            for (std::size_t i = range.begin(); i < range.end(); ++i) {
                const std::uint32_t a = of[2 * i], b = of[2 * i + 1];
                to[i] = distance({*bodies[a], placements[a]}, {*bodies[b], placements[b]}, options).distance;
            }
        });
    }
    return distances;
}

constexpr const char* collideDoc =
    R"(collide(a, pose_a, b, pose_b, *, margin=0, exact=False, scale_a=1, scale_b=1, motion_a=None, motion_b=None,
        min_normal_cosine=0.3, min_normal_cosine_apart=0.9, keeps_oblique_edges=False, cache=None) -> Contacts

The contacts of two bodies: where surface points of each are within `margin` of the other.

a, b: Collider. pose_a, pose_b: a Pose, a matrix of shape (4, 4), or None.
margin: contacts are reported up to this separation, in the meshes' unit.
exact: take distances from the triangles everywhere.
scale_a, scale_b: uniform scales, above 0.
motion_a, motion_b: displacement and rotation vector over the step, shape (2, 3), for speculative contacts.
min_normal_cosine, min_normal_cosine_apart, keeps_oblique_edges: the filter of contacts at inner edges.
cache: the ContactCache of this pair, which makes the next call faster and changes no contact.

position: float32 (N, 3), on the surface of b. normal: float32 (N, 3), from b to a. distance: float32 (N,), negative
where the bodies penetrate. feature: uint32 (N,), which point or edge; the top bit is set for those of b. approach and
turning_radius: float32 (N,). points_tested, beyond_band: int, points sampled, and those too deep for the band.

Raises ValueError that names the argument.

>>> import bilayer
>>> box = bilayer.box()
>>> body = bilayer.Collider(box, bilayer.build(box, resolution=32))
>>> contacts = bilayer.collide(body, bilayer.Pose((0, 0, 0.99)), body, None, margin=0.02)
>>> round(float(contacts.distance.min()), 4), contacts.normal[0].tolist()
(-0.01, [0.0, 0.0, 1.0])
)";

constexpr const char* distanceDoc =
    R"(distance(a, pose_a, b, pose_b, *, scale_a=1, scale_b=1, max_distance=inf) -> BodyDistance

The signed distance of two bodies, between their triangles.

a, b: Collider. pose_a, pose_b: a Pose, a matrix of shape (4, 4), or None.
max_distance: bodies farther apart are not found.

found: bool. overlap: "none", "surfaces", "a inside b" or "b inside a". distance: the separation, or minus the
penetration depth. position_a, position_b: float32 (3,), the closest points. normal: float32 (3,), from b to a.
triangle_a, triangle_b: faces of the closest points, -1 where not known.

>>> import bilayer
>>> box = bilayer.box()
>>> body = bilayer.Collider(box, bilayer.build(box, resolution=16))
>>> bilayer.distance(body, bilayer.Pose((3, 0, 0)), body, None).distance
2.0
)";

constexpr const char* distancesDoc = R"(distances(colliders, poses, pairs, max_distance=inf) -> float32 (N,)

The distances of many pairs of bodies, on all cores. inf for a pair farther apart than max_distance.

colliders: a Collider, or one for each pose. poses: a sequence of poses. pairs: integers of shape (N, 2), indices of
poses.

>>> import bilayer
>>> box = bilayer.box()
>>> body = bilayer.Collider(box, bilayer.build(box, resolution=16))
>>> bilayer.distances(body, [bilayer.Pose((2 * i, 0, 0)) for i in range(3)], [[0, 1], [0, 2]]).tolist()
[1.0, 3.0]
)";

}  // namespace

void addContact(py::module_& module) {
    py::class_<LockedCache>(
        module, "ContactCache",
        "ContactCache()\n\nWhat collide() keeps for a pair of bodies between steps, to find the same "
        "contacts faster. One for each pair.")
        .def(py::init<>());
    module.def("collide", findContacts, py::arg("a"), py::arg("pose_a"), py::arg("b"), py::arg("pose_b"), py::kw_only(),
               py::arg("margin") = 0.f, py::arg("exact") = false, py::arg("scale_a") = 1.f, py::arg("scale_b") = 1.f,
               py::arg("motion_a") = py::none(), py::arg("motion_b") = py::none(), py::arg("min_normal_cosine") = 0.3f,
               py::arg("min_normal_cosine_apart") = 0.9f, py::arg("keeps_oblique_edges") = false,
               py::arg("cache") = py::none(), collideDoc);
    const auto unlimited = py::arg("max_distance") = std::numeric_limits<float>::infinity();
    module.def("distance", findDistance, py::arg("a"), py::arg("pose_a"), py::arg("b"), py::arg("pose_b"),
               py::kw_only(), py::arg("scale_a") = 1.f, py::arg("scale_b") = 1.f, unlimited, distanceDoc);
    module.def("distances", findDistances, py::arg("colliders"), py::arg("poses"), py::arg("pairs"), unlimited,
               distancesDoc);
}

}  // namespace bilayer::python
