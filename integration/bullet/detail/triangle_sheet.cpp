// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/triangle_sheet.h"

#include <BulletCollision/CollisionShapes/btTriangleCallback.h>

#include "integration/bullet/detail/convert.h"

namespace bilayer::bullet::detail {

namespace {

/// Numbers the triangles by part and index. The two triangles of a height field's cell arrive in succession with the
/// same numbers.
class Passing : public btTriangleCallback {
  public:
    explicit Passing(const TriangleSheet::Visitor& visitor) : visitor_(visitor) {}

    void processTriangle(btVector3* corners, int part, int index) override {
        const bool isSecond = part == lastPart_ && index == lastIndex_;
        lastPart_ = isSecond ? -1 : part;
        lastIndex_ = index;
        const auto number = (std::uint64_t(std::uint32_t(part)) << 32 | std::uint32_t(index)) << 1;
        visitor_({toGlm(corners[0]), toGlm(corners[1]), toGlm(corners[2])}, number | std::uint64_t(isSecond));
    }

  private:
    const TriangleSheet::Visitor& visitor_;
    int lastPart_ = -1, lastIndex_ = -1;
};

}  // namespace

TriangleSheet sheetOf(const btConcaveShape& shape) {
    return {[&shape](const Bounds& box, const TriangleSheet::Visitor& visitor) {
        Passing passing(visitor);
        shape.processAllTriangles(&passing, toBullet(box.lower), toBullet(box.upper));
    }};
}

}  // namespace bilayer::bullet::detail
