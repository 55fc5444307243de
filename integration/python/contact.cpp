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
#include "integration/python/define.h"
#include "integration/python/placed.h"
#include "integration/python/without_gil.h"

namespace bilayer::python {
namespace {

// A contact cache that calls from several threads take in turn.
struct LockedCache {
    ContactCache cache;
    std::mutex mutex;
};

// Values below -1 switch a filter off.
void requireCosine(float value, const char* name) {
    if (!(value <= 1))
        throw std::invalid_argument(fmt::format("{} is {}, and must be a cosine, at most 1", name, value));
}

py::object findContacts(const py::object& a, const py::object& poseA, const py::object& b, const py::object& poseB,
                        float margin, bool exact, float scaleA, float scaleB, const py::object& motionA,
                        const py::object& motionB, float minNormalCosine, float minNormalCosineApart,
                        bool keepObliqueEdges, bool reduced, LockedCache* cache) {
    requireNotNegative(margin, "margin");
    requireCosine(minNormalCosine, "min_normal_cosine");
    requireCosine(minNormalCosineApart, "min_normal_cosine_apart");
    const PlacedShape first = placed(a, poseA, scaleA, motionA, "a"), second = placed(b, poseB, scaleB, motionB, "b");
    const ContactOptions options{.margin = margin,
                                 .exact = exact,
                                 .minNormalCosine = minNormalCosine,
                                 .minNormalCosineApart = minNormalCosineApart,
                                 .keepsObliqueEdges = keepObliqueEdges,
                                 .reduced = reduced};
    std::vector<Contact> contacts;
    ContactReport report;
    {
        const WithoutGil release;
        std::unique_lock<std::mutex> lock;
        if (cache) lock = std::unique_lock(cache->mutex);
        report = collide(first, second, options, contacts, cache ? &cache->cache : nullptr);
    }
    const auto count = py::ssize_t(contacts.size());
    const Records<Contact> records(std::move(contacts), {count});
    return result("Contacts", records.member(&Contact::position), records.member(&Contact::normal),
                  records.member(&Contact::distance), records.member(&Contact::feature).attr("view")("uint32"),
                  records.member(&Contact::approach), records.member(&Contact::roundingRadius), report.pointsTested,
                  report.beyondBand);
}

constexpr const char* collideDoc =
    R"(collide(a, pose_a, b, pose_b, *, margin=0, exact=False, scale_a=1, scale_b=1, motion_a=None, motion_b=None,
        min_normal_cosine=0.3, min_normal_cosine_apart=0.9, keep_oblique_edges=False, reduced=False,
        cache=None) -> Contacts

The contacts of two bodies: where surface points of each are within `margin` of the other.

a, b: Collider or Shape, one of them a Collider. pose_a, pose_b: a Pose, a matrix of shape (4, 4), or None.
margin: contacts are reported up to this separation, in the meshes' unit. Points beyond the band find the closest point
of the surface, which is slower; half_width_voxels of margin / voxel_size + 1.74 makes a band that is wide enough.
exact: take distances from the triangles everywhere.
scale_a, scale_b: uniform scales, above 0.
motion_a, motion_b: displacement and rotation vector over the step, shape (2, 3), for speculative contacts.
min_normal_cosine: a contact counts only if the cosine between the point's own normal and the surface's reversed normal
is at least this. If this and min_normal_cosine_apart are below -1, it always counts.
min_normal_cosine_apart: the same for face points that are apart, or less than a thousandth of a voxel deep; they would
    otherwise catch on inner edges.
keep_oblique_edges: also keep contacts of face points with edges that they see obliquely.
reduced: keep the few contacts of each patch that a solver needs, up to twelve.
cache: the ContactCache of this pair, which makes the next call faster; reduced contacts then stay the same at rest.

The answer is true, and has a length above 0, if there are contacts. Points deeper inside than the band make none;
beyond_band counts them.

Raises ValueError that names the argument.

>>> import bilayer
>>> box = bilayer.box()
>>> body = bilayer.Collider(box, bilayer.build(box, resolution=32))
>>> contacts = bilayer.collide(body, bilayer.Pose((0, 0, 0.99)), body, None, margin=0.02)
>>> len(contacts) > 0, round(float(contacts.distance.min()), 4), contacts.normal[0].tolist()
(True, -0.01, [0.0, 0.0, 1.0])
)";

constexpr const char* cacheDoc = R"(ContactCache()

What collide() keeps for a pair of bodies between steps, to find the same contacts faster. One for each pair.

>>> import bilayer
>>> box = bilayer.box()
>>> body, cache = bilayer.Collider(box, bilayer.build(box, resolution=16)), bilayer.ContactCache()
>>> len(bilayer.collide(body, bilayer.Pose((0, 0, 0.99)), body, None, cache=cache)) > 0
True
)";

}  // namespace

void addContact(py::module_& module) {
    py::class_<LockedCache> type(module, "ContactCache", cacheDoc);
    defineConstructor(type, cacheDoc, [] { return std::make_unique<LockedCache>(); });
    type.def("__repr__", [](const py::object&) { return "ContactCache()"; })
        .def("__reduce__", [](const py::object&) -> py::object {
            throw py::type_error("a ContactCache cannot be copied or pickled: make one for each pair of bodies");
        });
    define(module, collideDoc, findContacts);
}

}  // namespace bilayer::python
