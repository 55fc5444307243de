// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/waves.h"

#include <BulletCollision/CollisionShapes/btHeightfieldTerrainShape.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <vector>

#include "demos/shared/triangle_shape.h"

namespace bilayer::demo {
namespace {

constexpr float solidBottom = -0.4f;  // of the closed solid [m]

/// Bullet keeps a pointer to the heights.
struct HeightField {
    std::vector<float> heights;
    std::unique_ptr<btHeightfieldTerrainShape> shape;
};

std::shared_ptr<btConcaveShape> heightField(std::vector<float> heights, int columns, int rows, float cell) {
    auto field = std::make_shared<HeightField>();
    field->heights = std::move(heights);
    field->shape = std::make_unique<btHeightfieldTerrainShape>(columns, rows, field->heights.data(), 1, -1, 1, 2,
                                                               PHY_FLOAT, false);
    field->shape->setLocalScaling({cell, cell, 1});
    return {field, field->shape.get()};
}

std::shared_ptr<btConcaveShape> triangleMesh(const Mesh& mesh) {
    auto triangles = std::make_shared<TriangleShape>(mesh);
    return {triangles, triangles->shape.get()};
}

double squaredDistance(const glm::dvec3& place, const std::array<glm::dvec3, 3>& triangle) {
    const glm::dvec3 normal = glm::cross(triangle[1] - triangle[0], triangle[2] - triangle[0]);
    double smallest = std::numeric_limits<double>::max();
    bool isOver = true;
    for (int i = 0; i < 3; ++i) {
        const glm::dvec3 edge = triangle[(i + 1) % 3] - triangle[i], from = place - triangle[i];
        isOver = isOver && glm::dot(glm::cross(edge, from), normal) >= 0;
        const double part = std::clamp(glm::dot(from, edge) / glm::dot(edge, edge), 0.0, 1.0);
        smallest = std::min(smallest, glm::dot(from - part * edge, from - part * edge));
    }
    const double height = glm::dot(place - triangle[0], normal);
    return isOver ? height * height / glm::dot(normal, normal) : smallest;
}

/// Returns the angle between a direction and the cone spanned by others. It starts at the nearest of these and moves
/// towards each other one as long as that reduces the angle.
double angleToCone(const glm::dvec3& direction, const std::vector<glm::dvec3>& normals) {
    const auto isFarther = [&](const glm::dvec3& a, const glm::dvec3& b) {
        return glm::dot(a, direction) < glm::dot(b, direction);
    };
    glm::dvec3 nearest = *std::max_element(normals.begin(), normals.end(), isFarther);
    for (int round = 0; round < 20; ++round)
        for (const glm::dvec3& normal : normals) {
            const double a = glm::dot(direction, nearest), b = glm::dot(direction, normal),
                         c = glm::dot(nearest, normal);
            const double towards = b - a * c, along = a - b * c;
            if (towards > 0 && along > 0) nearest = glm::normalize(along * nearest + towards * normal);
        }
    return std::acos(std::clamp(glm::dot(direction, nearest), -1.0, 1.0));
}

}  // namespace

Waves::Waves(const WavesOptions& options)
    : options_(options), cellsX_(int(std::ceil(length / options.cell))), cellsY_(int(std::ceil(width / options.cell))) {
    addSolid();
    if (options.heightField) {
        std::vector<float> heights;
        for (int j = 0; j <= cellsY_; ++j)
            for (int i = 0; i <= cellsX_; ++i) heights.push_back(cornerAt(i, j).z);
        shape_ = heightField(std::move(heights), cellsX_ + 1, cellsY_ + 1, options.cell);
    } else {
        shape_ = triangleMesh(solid_);
    }
}

glm::vec3 Waves::cornerAt(int i, int j) const {
    const float x = options_.cell * (float(i) - 0.5f * float(cellsX_)),
                y = options_.cell * (float(j) - 0.5f * float(cellsY_));
    return {x, y, options_.height * std::sin(2.1f * x + 1) * std::cos(1.3f * y)};
}

void Waves::addSolid() {
    const auto columns = unsigned(cellsX_ + 1), rows = unsigned(cellsY_ + 1), below = columns * rows;
    for (int j = 0; j <= cellsY_; ++j)
        for (int i = 0; i <= cellsX_; ++i) solid_.points.push_back(cornerAt(i, j));
    for (unsigned i = 0; i < below; ++i) {
        const glm::vec3 point = solid_.points[i];
        solid_.points.emplace_back(point.x, point.y, solidBottom);
    }
    // squares are divided in the same way as in a btHeightfieldTerrainShape
    for (unsigned j = 0; j + 1 < rows; ++j)
        for (unsigned i = 0; i + 1 < columns; ++i) {
            const unsigned a = j * columns + i, b = a + 1, c = a + columns, d = c + 1;
            solid_.triangles.insert(solid_.triangles.end(), {{a, b, c}, {b, d, c}});
            const glm::uvec3 one{a + below, c + below, b + below}, other{b + below, c + below, d + below};
            solid_.triangles.insert(solid_.triangles.end(), {one, other});
        }
    const auto addWall = [&](unsigned from, unsigned to) {
        solid_.triangles.push_back({to, from, from + below});
        solid_.triangles.push_back({to, from + below, to + below});
    };
    for (unsigned i = 0; i + 1 < columns; ++i) {
        addWall(i, i + 1);
        addWall((rows - 1) * columns + i + 1, (rows - 1) * columns + i);
    }
    for (unsigned j = 0; j + 1 < rows; ++j) {
        addWall((j + 1) * columns, j * columns);
        addWall(j * columns + columns - 1, (j + 1) * columns + columns - 1);
    }
}

float Waves::highestAround(float x, float y, float distance) const {
    float highest = solidBottom;
    const float reach = distance + options_.cell;
    for (int j = 0; j <= cellsY_; ++j)
        for (int i = 0; i <= cellsX_; ++i)
            if (const glm::vec3 corner = cornerAt(i, j);
                std::max(std::abs(corner.x - x), std::abs(corner.y - y)) <= reach)
                highest = std::max(highest, corner.z);
    return highest;
}

double Waves::angleToNormals(const glm::dvec3& place, const glm::dvec3& direction, double within) const {
    std::vector<glm::dvec3> normals;
    const double cell = options_.cell;
    const int i = int(std::floor(place.x / cell + 0.5 * cellsX_)), j = int(std::floor(place.y / cell + 0.5 * cellsY_));
    const int around = 1 + int(within / cell);
    const auto consider = [&](const std::array<glm::dvec3, 3>& triangle) {
        if (squaredDistance(place, triangle) <= within * within)
            normals.push_back(glm::normalize(glm::cross(triangle[1] - triangle[0], triangle[2] - triangle[0])));
    };
    for (int v = std::max(j - around, 0); v <= std::min(j + around, cellsY_ - 1); ++v)
        for (int u = std::max(i - around, 0); u <= std::min(i + around, cellsX_ - 1); ++u) {
            const glm::dvec3 a(cornerAt(u, v)), b(cornerAt(u + 1, v)), c(cornerAt(u, v + 1)), d(cornerAt(u + 1, v + 1));
            consider({a, b, c});
            consider({b, d, c});
        }
    return normals.empty() ? std::numeric_limits<double>::infinity() : angleToCone(direction, normals);
}

}  // namespace bilayer::demo
