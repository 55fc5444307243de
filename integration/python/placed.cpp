// SPDX-License-Identifier: Apache-2.0
#include "integration/python/placed.h"

#include <string>

#include "integration/python/arguments.h"
#include "integration/python/arrays.h"
#include "integration/python/convert.h"

namespace bilayer::python {
namespace {

Motion motionOf(const py::object& object, const char* name) {
    if (object.is_none()) return {};
    const Floats motion(object, name, {2, 3}, Range::finite, Items::one);
    return {motion.points()[0], motion.points()[1]};
}

ContactShape shapeOf(const py::object& body, const char* name) {
    if (py::isinstance<ColliderObject>(body)) return ContactShape(body.cast<const ColliderObject&>());
    if (py::isinstance<ShapeObject>(body)) return body.cast<const ShapeObject&>();
    refuseType(name, "a Collider or a Shape", body);
}

}  // namespace

PlacedShape placed(const py::object& body, const py::object& pose, float scale, const py::object& motion,
                   const char* name) {
    const std::string suffix = std::string("_") + name;
    requirePositive(scale, "scale" + suffix);
    return {shapeOf(body, name), poseOf(pose, ("pose" + suffix).c_str()), scale,
            motionOf(motion, ("motion" + suffix).c_str())};
}

}  // namespace bilayer::python
