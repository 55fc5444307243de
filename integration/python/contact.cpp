// SPDX-License-Identifier: Apache-2.0
// collide(): the contacts of two posed bodies.
#include <bilayer/collider/contact.h>

#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "integration/python/arguments.h"
#include "integration/python/arrays.h"
#include "integration/python/bindings.h"
#include "integration/python/placed.h"

namespace bilayer::python {
namespace {

// A contact cache that calls from several threads take in turn.
struct LockedCache {
    ContactCache cache;
    std::mutex mutex;
};

py::object findContacts(const py::object& a, const py::object& poseA, const py::object& b, const py::object& poseB,
                        float margin, bool exact, float scaleA, float scaleB, const py::object& motionA,
                        const py::object& motionB, float minNormalCosine, float minNormalCosineApart,
                        bool keepsObliqueEdges, bool reduced, LockedCache* cache) {
    if (!(margin >= 0) || !std::isfinite(margin))
        throw std::invalid_argument(fmt::format("margin is {}, and must be 0 or above", margin));
    for (const auto& [value, name] :
         {std::pair(minNormalCosine, "min_normal_cosine"), std::pair(minNormalCosineApart, "min_normal_cosine_apart")})
        if (std::isnan(value)) throw std::invalid_argument(fmt::format("{} is nan, and must be a cosine", name));
    const PlacedShape first = placed(a, poseA, scaleA, motionA, "a"), second = placed(b, poseB, scaleB, motionB, "b");
    const ContactOptions options{.margin = margin,
                                 .exact = exact,
                                 .minNormalCosine = minNormalCosine,
                                 .minNormalCosineApart = minNormalCosineApart,
                                 .keepsObliqueEdges = keepsObliqueEdges,
                                 .reduced = reduced};
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

constexpr const char* collideDoc =
    R"(collide(a, pose_a, b, pose_b, *, margin=0, exact=False, scale_a=1, scale_b=1, motion_a=None, motion_b=None,
        min_normal_cosine=0.3, min_normal_cosine_apart=0.9, keeps_oblique_edges=False, reduced=False, cache=None) -> Contacts

The contacts of two bodies: where surface points of each are within `margin` of the other.

a, b: Collider or Shape, one of them a Collider. pose_a, pose_b: a Pose, a matrix of shape (4, 4), or None.
margin: contacts are reported up to this separation, in the meshes' unit.
exact: take distances from the triangles everywhere.
scale_a, scale_b: uniform scales, above 0.
motion_a, motion_b: displacement and rotation vector over the step, shape (2, 3), for speculative contacts.
min_normal_cosine, min_normal_cosine_apart, keeps_oblique_edges: the filter of contacts at inner edges.
reduced: keep the few contacts of each patch that a solver needs, up to twelve.
cache: the ContactCache of this pair, which makes the next call faster; reduced contacts then stay the same at rest.

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

constexpr const char* cacheDoc = R"(ContactCache()

What collide() keeps for a pair of bodies between steps, to find the same contacts faster. One for each pair.

>>> import bilayer
>>> box = bilayer.box()
>>> body, cache = bilayer.Collider(box, bilayer.build(box, resolution=16)), bilayer.ContactCache()
>>> len(bilayer.collide(body, bilayer.Pose((0, 0, 0.99)), body, None, cache=cache).distance) > 0
True
)";

}  // namespace

void addContact(py::module_& module) {
    py::class_<LockedCache>(module, "ContactCache", cacheDoc).def(py::init<>());
    module.def("collide", findContacts, py::arg("a"), py::arg("pose_a"), py::arg("b"), py::arg("pose_b"), py::kw_only(),
               py::arg("margin") = 0.f, py::arg("exact") = false, py::arg("scale_a") = 1.f, py::arg("scale_b") = 1.f,
               py::arg("motion_a") = py::none(), py::arg("motion_b") = py::none(), py::arg("min_normal_cosine") = 0.3f,
               py::arg("min_normal_cosine_apart") = 0.9f, py::arg("keeps_oblique_edges") = false,
               py::arg("reduced") = false, py::arg("cache") = py::none(), collideDoc);
}

}  // namespace bilayer::python
