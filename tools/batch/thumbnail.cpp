// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/thumbnail.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>

namespace bilayer::tools {
namespace {

constexpr float margin = 3;                 // empty border [pixels]
constexpr std::uint8_t background = 255;    // white, as the page
constexpr float darkest = 30, range = 200;  // grey of a triangle seen from its edge, and what a facing one has more
constexpr float depthShare = 0.35f;         // share of the brightness that shows the depth

// Axes of the picture: to the right, upwards, and towards the viewer.
const glm::vec3 toViewer = glm::normalize(glm::vec3(1, -1.4f, 0.9f));
const glm::vec3 right = glm::normalize(glm::cross(glm::vec3(0, 0, 1), toViewer));
const glm::vec3 up = glm::cross(toViewer, right);

// Pixel coordinates from the top left corner, and the depth in 0..1 towards the viewer.
class View {
  public:
    explicit View(const Mesh& mesh) {
        for (const glm::uvec3& t : mesh.triangles)
            for (int k = 0; k < 3; ++k) box_.add(turned(mesh.points[t[k]]));
        const glm::vec3 size = box_.size();
        const float side = std::max({size.x, size.y, std::numeric_limits<float>::min()});
        scale_ = (thumbnailSize - 2 * margin) / side;
        depth_ = 1 / std::max(size.z, std::numeric_limits<float>::min());
    }

    glm::vec3 operator()(const glm::vec3& point) const {
        const glm::vec3 p = turned(point) - box_.centre();
        return {0.5f * thumbnailSize + scale_ * p.x, 0.5f * thumbnailSize - scale_ * p.y, 0.5f + depth_ * p.z};
    }

  private:
    static glm::vec3 turned(const glm::vec3& p) { return {glm::dot(p, right), glm::dot(p, up), glm::dot(p, toViewer)}; }

    Bounds box_;
    float scale_, depth_;
};

class DepthImage {
  public:
    // Draws a triangle in pixel coordinates. Corners need not be ordered.
    void draw(const glm::vec3& a, const glm::vec3& b, const glm::vec3& c, float facing) {
        // coordinates near the limits of floats overflow
        if (!isInside(a) || !isInside(b) || !isInside(c) || !std::isfinite(facing)) return;
        // thin parts cover no pixel centre
        for (const glm::vec3* p : {&a, &b, &c}) set(int(p->x), int(p->y), p->z, facing);
        const float area = cross(b - a, c - a);
        if (!(std::abs(area) > 0)) return;
        const auto [left, rightmost] = pixels(a.x, b.x, c.x);
        const auto [top, bottom] = pixels(a.y, b.y, c.y);
        for (int y = top; y <= bottom; ++y)
            for (int x = left; x <= rightmost; ++x) {
                const glm::vec3 p(float(x) + 0.5f, float(y) + 0.5f, 0);
                const float u = cross(c - b, p - b) / area, v = cross(a - c, p - c) / area, w = 1 - u - v;
                if (u >= 0 && v >= 0 && w >= 0) set(x, y, u * a.z + v * b.z + w * c.z, facing);
            }
    }

    GreyImage image() const { return image_; }

  private:
    static float cross(const glm::vec3& a, const glm::vec3& b) { return a.x * b.y - a.y * b.x; }

    static bool isInside(const glm::vec3& p) {
        return p.x >= 0 && p.x < thumbnailSize && p.y >= 0 && p.y < thumbnailSize && p.z >= -1 && p.z <= 2;
    }

    // The pixels whose centres lie between three coordinates.
    static std::pair<int, int> pixels(float a, float b, float c) {
        const float last = thumbnailSize - 1;
        return {int(std::clamp(std::ceil(std::min({a, b, c}) - 0.5f), 0.f, last)),
                int(std::clamp(std::floor(std::max({a, b, c}) - 0.5f), 0.f, last))};
    }

    void set(int x, int y, float depth, float facing) {
        const std::size_t at = std::size_t(y) * thumbnailSize + std::size_t(x);
        if (depth <= depths_[at]) return;
        depths_[at] = depth;
        image_.pixels[at] =
            std::uint8_t(darkest + range * ((1 - depthShare) * facing + depthShare * std::clamp(depth, 0.f, 1.f)));
    }

    GreyImage image_{thumbnailSize, thumbnailSize,
                     std::vector<std::uint8_t>(std::size_t(thumbnailSize) * thumbnailSize, background)};
    std::vector<float> depths_ = std::vector<float>(image_.pixels.size(), -1);
};

}  // namespace

GreyImage thumbnailOf(const Mesh& mesh) {
    const View view(mesh);
    DepthImage image;
    for (const glm::uvec3& t : mesh.triangles) {
        const glm::vec3 &a = mesh.points[t.x], &b = mesh.points[t.y], &c = mesh.points[t.z];
        const glm::vec3 normal = glm::cross(b - a, c - a);
        const float length = glm::length(normal);
        // open surfaces and flipped triangles are seen from both sides
        if (length > 0)
            image.draw(view(a), view(b), view(c), std::min(1.f, std::abs(glm::dot(normal, toViewer)) / length));
    }
    return image.image();
}

}  // namespace bilayer::tools
