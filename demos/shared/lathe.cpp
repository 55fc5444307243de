// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/lathe.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace bilayer::shapes::detail {
namespace {

constexpr int segmentStep = 24;  // puts vertices on the corners of hexagons and squares

// Returns curves between two others, excluding the first, at a spacing of about their edge length.
std::vector<Level> between(const Level& from, const Level& to) {
    double length = 0;
    for (int i = 0; i < segmentStep; ++i) {
        const double angle = 2 * pi * i / segmentStep;
        length = std::max(length, std::hypot(to.radius(angle) - from.radius(angle), to.height - from.height));
    }
    const bool pole = from.count == 1 || to.count == 1;
    const int cells = cellsOf(length, (from.edge() + to.edge()) / (pole ? 1 : 2));
    std::vector<Level> levels;
    for (int i = 1; i < cells; ++i) {
        const double t = double(i) / cells;
        const auto radius = [=](double angle) { return (1 - t) * from.radius(angle) + t * to.radius(angle); };
        const int count = int(std::lround((1 - t) * from.count + t * to.count));
        levels.push_back({radius, (1 - t) * from.height + t * to.height, std::max(minAround, count)});
    }
    levels.push_back(to);
    return levels;
}

}  // namespace

void require(bool met, const char* what) {
    if (!met) throw std::invalid_argument(what);
}

void requireSegments(int segments) {
    require(segments > 0 && segments % segmentStep == 0, "a round part needs a multiple of 24 segments");
}

int cellsOf(double length, double edge) {
    return std::max(1, int(std::lround(length / edge)));
}

glm::vec3 aroundAxis(double radius, double angle, double height) {
    return glm::vec3(glm::dvec3(radius * std::cos(angle), radius * std::sin(angle), height));
}

unsigned addPoint(Mesh& mesh, const glm::vec3& point) {
    mesh.points.push_back(point);
    return unsigned(mesh.points.size() - 1);
}

void zip(Mesh& mesh, const Row& a, const Row& b) {
    std::size_t i = 0, j = 0;
    while (i + 1 < a.size() || j + 1 < b.size())
        if (j + 1 == b.size() || (i + 1 < a.size() && a[i + 1].key < b[j + 1].key)) {
            mesh.triangles.push_back({a[i].vertex, a[i + 1].vertex, b[j].vertex});
            ++i;
        } else {
            mesh.triangles.push_back({a[i].vertex, b[j + 1].vertex, b[j].vertex});
            ++j;
        }
}

Outline round(double radius) {
    return [=](double) { return radius; };
}

Outline roundHole(double radius, int segments) {
    return round(radius / std::cos(pi / segments));
}

Outline polygon(int sides, double apothem) {
    return [=](double angle) { return apothem / std::cos(std::remainder(angle, 2 * pi / sides)); };
}

Level apex(double height) {
    return {round(0), height, 1};
}

const Row& Lathe::begin(const Level& level) {
    return begin(level, addRow(level));
}

const Row& Lathe::begin(const Level& level, const Row& row) {
    level_ = level;
    return row_ = row;
}

const Row& Lathe::to(const Level& level, const Row* last) {
    const auto levels = between(level_, level);
    for (const Level& next : levels) {
        const Row row = last && &next == &levels.back() ? *last : addRow(next);
        zip(mesh_, row_, row);
        row_ = row;
    }
    level_ = level;
    return row_;
}

Row Lathe::addRow(const Level& level) {
    Row row;
    const double start = row_.empty() ? 0 : row_.front().key;
    for (int i = 0; i < level.count; ++i) {
        const double turn = start + double(i) / level.count, angle = 2 * pi * turn;
        row.push_back({addPoint(mesh_, aroundAxis(level.radius(angle), angle, level.height)), turn});
    }
    if (level.count > 1) row.push_back({row.front().vertex, start + 1});
    return row;
}

}  // namespace bilayer::shapes::detail
