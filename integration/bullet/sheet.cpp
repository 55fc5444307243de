#include "integration/bullet/sheet.h"

#include <BulletCollision/CollisionShapes/btTriangleCallback.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <map>
#include <optional>
#include <set>

#include "integration/bullet/convert.h"

namespace bilayer::bullet {

namespace {

// Of the directions from a side or a corner into its triangles the mean is no shorter where these are folded by more
// than 30 degrees (a side's), or leave as sharp a corner.
constexpr float leastMean = 0.26f;
constexpr int mostPieces = 64;  // that a way is divided into

/// Away from all of these together, if they do not surround the place.
class Away {
  public:
    void add(const glm::vec3& direction, float weight) {
        sum_ += weight * direction;
        weight_ += weight;
    }
    std::optional<glm::vec3> outward() const {
        const float length = glm::length(sum_);
        if (!(length > leastMean * weight_)) return std::nullopt;
        return -sum_ / length;
    }

  private:
    glm::vec3 sum_{0};
    float weight_ = 0;
};

}  // namespace

glm::vec3 wingOf(const Triangle& triangle, int side) {
    const glm::vec3 &from = triangle[side], &to = triangle[(side + 1) % 3], &opposite = triangle[(side + 2) % 3];
    const glm::vec3 along = to - from, way = opposite - from;
    const float squared = glm::dot(along, along);
    const glm::vec3 across = squared > 0 ? way - glm::dot(way, along) / squared * along : way;
    const float length = glm::length(across);
    return length > 0 ? across / length : glm::vec3(0);
}

SideKey keyOf(const Triangle& triangle, int side) {
    const glm::vec3 &a = triangle[side], &b = triangle[(side + 1) % 3];
    const SideKey key{a.x, a.y, a.z, b.x, b.y, b.z}, back{b.x, b.y, b.z, a.x, a.y, a.z};
    return std::min(key, back);
}

SharpSheet sharpOf(std::span<const Triangle> triangles) {
    std::map<SideKey, Away> sides;
    std::map<std::array<float, 3>, Away> corners;
    for (const Triangle& triangle : triangles)
        for (int i = 0; i < 3; ++i) {
            if (const glm::vec3 wing = wingOf(triangle, i); wing != glm::vec3(0))
                sides[keyOf(triangle, i)].add(wing, 1);
            const glm::vec3 &here = triangle[i], one = triangle[(i + 1) % 3] - here, two = triangle[(i + 2) % 3] - here;
            if (!(glm::dot(one, one) > 0 && glm::dot(two, two) > 0)) continue;
            const glm::vec3 sum = glm::normalize(one) + glm::normalize(two);
            const float angle = 2 * std::acos(std::min(0.5f * glm::length(sum), 1.f));
            if (angle > 0 && glm::length(sum) > 0) corners[{here.x, here.y, here.z}].add(glm::normalize(sum), angle);
        }
    SharpSheet sharp;
    for (const auto& [key, away] : sides)
        if (const auto outward = away.outward())
            sharp.sides.push_back({{key[0], key[1], key[2]}, {key[3], key[4], key[5]}, *outward});
    for (const auto& [place, away] : corners)
        if (const auto outward = away.outward()) sharp.corners.push_back({{place[0], place[1], place[2]}, *outward});
    return sharp;
}

std::vector<Triangle> trianglesAlong(const btConcaveShape& mesh, std::span<const glm::vec3> way, float radius) {
    struct All : btTriangleCallback {
        std::set<std::array<float, 9>> seen;
        std::vector<Triangle> triangles;

        void processTriangle(btVector3* corners, int, int) override {
            const glm::vec3 a = toGlm(corners[0]), b = toGlm(corners[1]), c = toGlm(corners[2]);
            if (seen.insert({a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z}).second) triangles.push_back({a, b, c});
        }
    } all;
    for (std::size_t i = 0; i + 1 < way.size(); ++i) {
        const float pieces =
            std::clamp(std::ceil(glm::distance(way[i], way[i + 1]) / (2 * radius)), 1.f, float(mostPieces));
        for (float k = 0; k < pieces; ++k) {
            const glm::vec3 from = glm::mix(way[i], way[i + 1], k / pieces),
                            to = glm::mix(way[i], way[i + 1], (k + 1) / pieces);
            mesh.processAllTriangles(&all, toBullet(glm::min(from, to) - radius),
                                     toBullet(glm::max(from, to) + radius));
        }
    }
    return all.triangles;
}

}  // namespace bilayer::bullet
