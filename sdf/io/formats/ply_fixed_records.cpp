// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/formats/ply_fixed_records.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include "sdf/base/large_array.h"
#include "sdf/base/parallel_parts.h"

namespace bilayer::detail {
namespace {

/// Returns the byte offsets of each value or list in a record, and the size of the record.
/// @param listLength  items per list
std::vector<std::size_t> offsetsOf(const PlyElement& element, std::size_t listLength) {
    std::vector<std::size_t> offsets{0};
    for (const PlyProperty& p : element.properties) {
        const std::size_t size = p.countType ? sizeOf(*p.countType) + listLength * sizeOf(p.type) : sizeOf(p.type);
        offsets.push_back(offsets.back() + size);
    }
    return offsets;
}

template <class Stored, class Point>
bool readPoints(const PlyVertexRecords& records, const char* at, bool swapped, std::span<Point> points) {
    for (Point& point : points) {
        for (int axis = 0; axis < 3; ++axis)
            point[axis] = typename Point::value_type(loadPly<Stored>(at + records.offsets[axis], swapped));
        if (!std::isfinite(float(point.x)) || !std::isfinite(float(point.y)) || !std::isfinite(float(point.z)))
            return false;
        at += records.size;
    }
    return true;
}

/// Reads one record for each item. Returns false if one does not fit, or if the data is too short.
template <class Records, class Item>
bool readAllRecords(const Records& records, PlyData& data, std::vector<Item>& items) {
    if (data.size() / records.size < items.size()) return false;
    std::atomic<bool> fits = true;
    inParallel((items.size() + plyTaskElements - 1) / plyTaskElements, [&](std::size_t i) {
        const std::size_t first = i * plyTaskElements, count = std::min(plyTaskElements, items.size() - first);
        const std::span part(items.data() + first, count);
        if (fits && !records.read(data.at + first * records.size, data.swapped, part)) fits = false;
    });
    if (fits) data.at += items.size() * records.size;
    return fits;
}

}  // namespace

std::optional<PlyVertexRecords> PlyVertexRecords::of(const PlyElement& element) {
    if (element.kind() != PlyElementKind::vertex || element.count == 0) return std::nullopt;
    const auto x = element.find({"x"}), y = element.find({"y"}), z = element.find({"z"});
    if (!x || !y || !z) return std::nullopt;
    const std::vector<PlyProperty>& properties = element.properties;
    const PlyType type = properties[*x].type;
    if (element.hasLists() || properties[*y].type != type || properties[*z].type != type) return std::nullopt;
    const std::vector<std::size_t> offsets = offsetsOf(element, 0);
    return PlyVertexRecords{type, offsets.back(), {offsets[*x], offsets[*y], offsets[*z]}};
}

std::optional<PlyTriangleRecords> PlyTriangleRecords::of(const PlyElement& element, std::uint64_t vertices) {
    const auto list = element.findCorners();
    // negative corners, read as unsigned numbers, must exceed the count of vertices
    const bool isCountSmall = vertices <= std::uint64_t(std::numeric_limits<std::int32_t>::max());
    if (!list || !isCountSmall || element.count == 0) return std::nullopt;
    const PlyProperty& corners = element.properties[*list];
    const auto lists = std::count_if(element.properties.begin(), element.properties.end(),
                                     [](const PlyProperty& p) { return bool(p.countType); });
    const bool isUsual = corners.countType && sizeOf(*corners.countType) == 1 &&
                         (corners.type == PlyType::int32 || corners.type == PlyType::uint32);
    if (lists != 1 || !isUsual) return std::nullopt;
    const std::vector<std::size_t> offsets = offsetsOf(element, 3);
    return PlyTriangleRecords{vertices, offsets.back(), offsets[*list]};
}

bool PlyTriangleRecords::read(const char* at, bool swapped, std::span<glm::uvec3> triangles) const {
    for (glm::uvec3& t : triangles) {
        if (!isTriangle(at)) return false;
        for (int k = 0; k < 3; ++k)
            t[k] = loadPly<std::uint32_t>(at + offset + 1 + std::size_t(k) * sizeof(std::uint32_t), swapped);
        if (t.x >= vertices || t.y >= vertices || t.z >= vertices) return false;
        at += size;
    }
    return true;
}

template <class Point>
bool PlyVertexRecords::read(const char* at, bool swapped, std::span<Point> points) const {
    return withPlyType(type, [&](auto stored) { return readPoints<decltype(stored)>(*this, at, swapped, points); });
}

template <class Scalar>
bool readFixedVertices(const PlyElement& element, PlyData& data, std::vector<glm::vec<3, Scalar>>& points) {
    const auto records = PlyVertexRecords::of(element);
    return records && readAllRecords(*records, data, points);
}

bool readFixedTriangles(const PlyElement& element, std::uint64_t vertices, PlyData& data,
                        std::vector<glm::uvec3>& triangles) {
    const auto records = PlyTriangleRecords::of(element, vertices);
    if (!records || data.size() < records->size || !records->isTriangle(data.at)) return false;
    resizeLarge(triangles, element.count);
    if (readAllRecords(*records, data, triangles)) return true;
    triangles = {};
    return false;
}

template bool PlyVertexRecords::read(const char*, bool, std::span<glm::vec3>) const;
template bool PlyVertexRecords::read(const char*, bool, std::span<glm::dvec3>) const;
template bool readFixedVertices(const PlyElement&, PlyData&, std::vector<glm::vec<3, float>>&);
template bool readFixedVertices(const PlyElement&, PlyData&, std::vector<glm::vec<3, double>>&);

}  // namespace bilayer::detail
