// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/ply_fixed_records.h"

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

/// Vertices without lists whose coordinates all have the same type.
struct VertexRecords {
    PlyType type;
    std::size_t size, offsets[3];  // size of a record, and offset of each coordinate [bytes]

    static std::optional<VertexRecords> of(const PlyElement& element) {
        if (element.kind() != PlyElementKind::vertex || element.count == 0) return std::nullopt;
        const auto x = element.find({"x"}), y = element.find({"y"}), z = element.find({"z"});
        if (!x || !y || !z) return std::nullopt;
        const std::vector<PlyProperty>& properties = element.properties;
        const PlyType type = properties[*x].type;
        if (element.hasLists() || properties[*y].type != type || properties[*z].type != type) return std::nullopt;
        const std::vector<std::size_t> offsets = offsetsOf(element, 0);
        return VertexRecords{type, offsets.back(), {offsets[*x], offsets[*y], offsets[*z]}};
    }

    /// Returns false if a coordinate is not a finite float.
    template <class Point>
    bool read(const char* at, bool swapped, std::span<Point> points) const {
        return withPlyType(type, [&](auto stored) { return readAs<decltype(stored)>(at, swapped, points); });
    }

  private:
    template <class Stored, class Point>
    bool readAs(const char* at, bool swapped, std::span<Point> points) const {
        for (Point& point : points) {
            for (int axis = 0; axis < 3; ++axis)
                point[axis] = typename Point::value_type(loadPly<Stored>(at + offsets[axis], swapped));
            if (!std::isfinite(float(point.x)) || !std::isfinite(float(point.y)) || !std::isfinite(float(point.z)))
                return false;
            at += size;
        }
        return true;
    }
};

/// Faces that are mostly triangles: one byte for the count of corners, four bytes per corner, and no other list.
struct TriangleRecords {
    std::uint64_t vertices;
    std::size_t size, offset;  // size of a record, and offset of its list [bytes]

    static std::optional<TriangleRecords> of(const PlyElement& element, std::uint64_t vertices) {
        const auto list = element.findCorners();
        // provided that negative corners look like vertices that do not exist
        const bool isCountSmall = vertices <= std::uint64_t(std::numeric_limits<std::int32_t>::max());
        if (!list || !isCountSmall || element.count == 0) return std::nullopt;
        const PlyProperty& corners = element.properties[*list];
        const auto lists = std::count_if(element.properties.begin(), element.properties.end(),
                                         [](const PlyProperty& p) { return bool(p.countType); });
        const bool isUsual = corners.countType && sizeOf(*corners.countType) == 1 &&
                             (corners.type == PlyType::int32 || corners.type == PlyType::uint32);
        if (lists != 1 || !isUsual) return std::nullopt;
        const std::vector<std::size_t> offsets = offsetsOf(element, 3);
        return TriangleRecords{vertices, offsets.back(), offsets[*list]};
    }

    bool isTriangle(const char* record) const { return record[offset] == 3; }

    /// Returns false if a face is not a triangle or a corner is not a vertex.
    bool read(const char* at, bool swapped, std::span<glm::uvec3> triangles) const {
        for (glm::uvec3& t : triangles) {
            if (!isTriangle(at)) return false;
            for (int k = 0; k < 3; ++k)
                t[k] = loadPly<std::uint32_t>(at + offset + 1 + std::size_t(k) * sizeof(std::uint32_t), swapped);
            if (t.x >= vertices || t.y >= vertices || t.z >= vertices) return false;
            at += size;
        }
        return true;
    }
};

/// Reads one record for each item. Returns false if one does not fit, or if the data is too short.
template <class Records, class Item>
bool readAllRecords(const Records& records, PlyData& data, std::vector<Item>& items) {
    if (data.size() / records.size < items.size()) return false;
    std::atomic<bool> fits = true;
    inOrder((items.size() + plyTaskElements - 1) / plyTaskElements, [&](std::size_t i) {
        const std::size_t first = i * plyTaskElements, count = std::min(plyTaskElements, items.size() - first);
        const std::span part(items.data() + first, count);
        if (fits && !records.read(data.at + first * records.size, data.swapped, part)) fits = false;
    });
    if (fits) data.at += items.size() * records.size;
    return fits;
}

}  // namespace

template <class Scalar>
bool readFixedVertices(const PlyElement& element, PlyData& data, std::vector<glm::vec<3, Scalar>>& points) {
    const auto records = VertexRecords::of(element);
    return records && readAllRecords(*records, data, points);
}

bool readFixedTriangles(const PlyElement& element, std::uint64_t vertices, PlyData& data,
                        std::vector<glm::uvec3>& triangles) {
    const auto records = TriangleRecords::of(element, vertices);
    if (!records || data.size() < records->size || !records->isTriangle(data.at)) return false;
    resizeLarge(triangles, element.count);
    if (readAllRecords(*records, data, triangles)) return true;
    triangles = {};
    return false;
}

template bool readFixedVertices(const PlyElement&, PlyData&, std::vector<glm::vec<3, float>>&);
template bool readFixedVertices(const PlyElement&, PlyData&, std::vector<glm::vec<3, double>>&);

}  // namespace bilayer::detail
