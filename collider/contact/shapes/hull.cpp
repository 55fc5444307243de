// SPDX-License-Identifier: Apache-2.0
#include "collider/contact/shapes/hull.h"

#include <fmt/format.h>
#include <libqhull_r/qhull_ra.h>

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <glm/geometric.hpp>
#include <map>
#include <new>
#include <stdexcept>
#include <string>
#include <utility>

#include "sdf/base/finite.h"

namespace bilayer::detail {

namespace {

// Faces are one if their neighbours lie in their plane to this tolerance [sizes of the hull]: rounding of coordinates.
constexpr double coplanar = 1e-6;

/// A run of Qhull, and its memory.
class QhullRun {
  public:
    /// @param coordinates  three for each point
    QhullRun(std::vector<double>& coordinates, double size) : messages_(open_memstream(&text_, &textSize_)) {
        if (!messages_) throw std::bad_alloc();
        std::string command = fmt::format("qhull C-{}", coplanar * size);
        qh_zero(&qh_, messages_);
        const int count = int(coordinates.size() / 3);
        status_ = qh_new_qhull(&qh_, 3, count, coordinates.data(), False, command.data(), nullptr, messages_);
    }
    ~QhullRun() {
        qh_freeqhull(&qh_, !qh_ALL);
        int memory = 0, blocks = 0;
        qh_memfreeshort(&qh_, &memory, &blocks);
        std::fclose(messages_);
        std::free(text_);
    }
    QhullRun(const QhullRun&) = delete;
    QhullRun& operator=(const QhullRun&) = delete;

    bool succeeded() const { return status_ == 0; }
    qhT* state() { return &qh_; }

  private:
    char* text_ = nullptr;
    std::size_t textSize_ = 0;
    std::FILE* messages_;  // writes to `text_`, which is discarded
    qhT qh_;
    int status_;
};

/// The vertices of a face, counter-clockwise from outside, as indices of the given points.
std::vector<int> polygonOf(qhT* qh, facetT* face) {
    std::vector<int> polygon;
    setT* corners = qh_facet3vertex(qh, face);
    vertexT *vertex, **vertexp;
    FOREACHvertex_(corners) polygon.push_back(qh_pointid(qh, vertex->point));
    qh_settempfree(qh, &corners);
    return polygon;
}

glm::dvec3 areaOf(const std::vector<int>& polygon, std::span<const glm::vec3> points) {
    glm::dvec3 area(0);
    const auto at = [&](std::size_t i) { return glm::dvec3(points[std::size_t(polygon[i])]); };
    for (std::size_t i = 1; i + 1 < polygon.size(); ++i) area += glm::cross(at(i) - at(0), at(i + 1) - at(0));
    return area;
}

/// Numbers the used points in the order of their use, and lists each edge once.
HullSurface hullSurface(const std::vector<std::vector<int>>& polygons, std::span<const glm::vec3> points) {
    HullSurface surface;
    std::map<int, std::uint32_t> numbers;
    for (const std::vector<int>& polygon : polygons) {
        std::vector<std::uint32_t>& face = surface.faces.emplace_back();
        for (const int corner : polygon) {
            const auto [place, isNew] = numbers.emplace(corner, std::uint32_t(surface.points.size()));
            if (isNew) surface.points.push_back(points[std::size_t(corner)]);
            face.push_back(place->second);
        }
        for (std::size_t i = 0; i < face.size(); ++i)
            if (const std::uint32_t from = face[i], to = face[(i + 1) % face.size()]; from < to)
                surface.edges.emplace_back(from, to);
    }
    return surface;
}

}  // namespace

HullSurface convexHullOf(std::span<const glm::vec3> points) {
    std::vector<double> coordinates;
    Bounds box;
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (!isFinite(points[i])) throw std::invalid_argument(fmt::format("point {} of a hull is not finite", i));
        box.add(points[i]);
        for (int axis = 0; axis < 3; ++axis) coordinates.push_back(points[i][axis]);
    }
    const char* const flat = "the points of a hull must not lie in one plane";
    if (points.size() < 4) throw std::invalid_argument(flat);
    QhullRun run(coordinates, glm::length(glm::dvec3(box.size())));
    if (!run.succeeded()) throw std::invalid_argument(flat);
    qhT* qh = run.state();
    std::vector<std::vector<int>> polygons;
    facetT* facet;
    FORALLfacets {
        std::vector<int> polygon = polygonOf(qh, facet);
        const glm::dvec3 outward(facet->normal[0], facet->normal[1], facet->normal[2]);
        if (glm::dot(areaOf(polygon, points), outward) < 0) std::reverse(polygon.begin(), polygon.end());
        polygons.push_back(std::move(polygon));
    }
    return hullSurface(polygons, points);
}

}  // namespace bilayer::detail
