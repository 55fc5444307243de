// SPDX-License-Identifier: Apache-2.0
// The header of a PLY file: its elements and their properties; internal.
// Tested by tests/sdf/ply_reader.cpp through readMesh().
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sdf/io/text_source.h"

namespace bilayer::detail {

enum class PlyType { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

/// Returns the size of a binary value [bytes].
inline std::size_t sizeOf(PlyType type) {
    constexpr std::size_t sizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
    return sizes[int(type)];
}

inline bool isInteger(PlyType type) {
    return type < PlyType::float32;
}

struct PlyProperty {
    std::string name;
    PlyType type = PlyType::float32;
    std::optional<PlyType> countType;  ///< only for lists
};

enum class PlyElementKind { vertex, face, strips, other };

/// A table of the file: `count` records with the same properties.
struct PlyElement {
    std::string name;
    std::uint64_t count = 0;
    std::vector<PlyProperty> properties;

    PlyElementKind kind() const;
    bool hasFaces() const { return kind() == PlyElementKind::face || kind() == PlyElementKind::strips; }
    bool hasLists() const;
    /// Returns the index of the first property that has one of these names.
    std::optional<std::size_t> find(std::initializer_list<std::string_view> names) const;
    /// Returns the index of the property that contains the corners of faces.
    std::optional<std::size_t> findCorners() const { return find({"vertex_indices", "vertex_index"}); }
};

enum class PlyFormat { text, binaryLittle, binaryBig };

struct PlyHeader {
    std::filesystem::path path;  ///< the file, for errors
    PlyFormat format = PlyFormat::text;
    std::vector<PlyElement> elements;
    std::uint64_t vertices = 0;                   ///< count of vertices
    const char *begin = nullptr, *end = nullptr;  ///< start of the file, and of the data

    /// Returns whether floats can represent all coordinates.
    bool storesFloats() const;

    /// Throws std::runtime_error that names the file.
    [[noreturn]] void fail(const std::string& why) const;
    /// Returns the reason for an error: the file ends after this count of records of an element.
    std::string endsAfter(std::uint64_t records, const PlyElement& element) const;
};

/// Reads the lines up to `end_header`. Throws std::runtime_error that names the file and the line if they are not those
/// of a PLY header with exactly one element `vertex`.
PlyHeader readPlyHeader(const std::filesystem::path& path, const TextSource& source);

}  // namespace bilayer::detail
