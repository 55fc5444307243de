// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <fstream>
#include <glm/vec3.hpp>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include <bilayer/collider/field.h>
#include <bilayer/collider/mass.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/surface.h>
#include <bilayer/sdf/vdb_io.h>
#include "demos/shared/shapes.h"
#include "sdf/base/openvdb_points.h"
#include "tests/fuzz/byte_source.h"
#include "tests/fuzz/checks.h"
#include "tests/support/support.h"

namespace bilayer::test {
namespace {

constexpr openvdb::Index64 maxQueriedLeaves = 1000;  // larger fields of a small file are not queried: they take seconds
constexpr int maxQueriedSide = 4096;                 // [voxels]
constexpr unsigned maxEntryEdits = 3;

void useField(const LevelSet& levelSet) {
    const openvdb::FloatGrid& grid = *levelSet.grids().distance;
    const openvdb::Coord size = grid.evalActiveVoxelDim();
    if (grid.tree().leafCount() > maxQueriedLeaves || size[size.maxIndex()] > maxQueriedSide) return;
    try {
        const Field field(levelSet);
        for (const float x : {0.f, 0.1f, 1e6f}) {
            const glm::vec3 point = x * levelSet.voxelSize() * glm::vec3(1, 0.5f, 0.25f);
            (void)field.sample(point);
            (void)field.inside(point);
        }
        (void)surface(levelSet, {});
        if (!hasBody(levelSet)) return;
        const Collider collider(levelSet);
        std::vector<Contact> contacts;
        collide(collider, {}, collider, {{0.1f, 0.2f, 0.05f}, {1, 0, 0, 0}}, {.margin = 0.05f}, contacts);
        (void)collider.exactField().closest({0.1f, 0.2f, 0.3f});
    } catch (const std::invalid_argument& error) {
        requirePlainError(error.what());
    }
}

void readAndUse(const std::filesystem::path& path) {
    try {
        useField(readVdb(path));
    } catch (const std::runtime_error& error) {
        require(std::string(error.what()).starts_with(path.string() + ": "), "an error does not name the file");
        requirePlainError(std::string(error.what()).substr(path.string().size()));
    }
}

LevelSet fieldWithBody() {
    const Mesh mesh = shapes::box({0.2f, 0.15f, 0.1f});
    return withBody(build(mesh, {.voxelSize = 0.2f, .exteriorWidthVoxels = 1.5f, .interiorWidthVoxels = 1}), mesh);
}

/// An entry of any type with arbitrary contents.
openvdb::Metadata::Ptr arbitraryEntry(ByteSource& bytes) {
    const auto text = [&] {
        std::string value(bytes.below(40) * (bytes.flag() ? 1 : 100), ' ');
        for (char& c : value) c = char(bytes.byte());
        return value;
    };
    using namespace openvdb;
    switch (bytes.below(9)) {
        case 0:
            return std::make_shared<FloatMetadata>(bytes.anyFloat());
        case 1:
            return std::make_shared<DoubleMetadata>(bytes.anyFloat());
        case 2:
            return std::make_shared<Int32Metadata>(bytes.number<std::int32_t>());
        case 3:
            return std::make_shared<Int64Metadata>(bytes.number<std::int64_t>());
        case 4: {
            const glm::vec3 v = bytes.anyVector();
            return std::make_shared<Vec3SMetadata>(Vec3s(v.x, v.y, v.z));
        }
        case 5: {
            const glm::vec3 v = bytes.anyVector();
            return std::make_shared<Vec3DMetadata>(Vec3d(v.x, v.y, v.z));
        }
        case 6: {
            const glm::vec3 v = bytes.anyVector();
            return std::make_shared<Vec4SMetadata>(Vec4s(v.x, v.y, v.z, bytes.anyFloat()));
        }
        case 7:
            return std::make_shared<BoolMetadata>(bytes.flag());
        default:
            return std::make_shared<StringMetadata>(text());
    }
}

/// Flips some bytes of an entry, and keeps its type and size.
openvdb::Metadata::Ptr changedEntry(const openvdb::Metadata& entry, ByteSource& bytes) {
    std::ostringstream out(std::ios::binary);
    entry.write(out);
    std::string data = out.str();
    constexpr std::size_t head = 4;  // the size, of which OpenVDB allocates memory
    for (unsigned count = 1 + bytes.below(4); count > 0 && data.size() > head; --count)
        data[head + bytes.below(65536) % (data.size() - head)] = char(bytes.byte());
    std::istringstream in(data, std::ios::binary);
    const openvdb::Metadata::Ptr changed = entry.copy();
    changed->read(in);
    return changed;
}

void editEntry(openvdb::FloatGrid& grid, ByteSource& bytes) {
    auto entry = grid.beginMeta();
    std::advance(entry, bytes.below(unsigned(grid.metaCount())));
    const std::string name = entry->first;
    const std::uint8_t kind = bytes.byte() % 4;
    const openvdb::Metadata::Ptr changed = kind == 0   ? nullptr
                                           : kind == 1 ? arbitraryEntry(bytes)
                                                       : changedEntry(*entry->second, bytes);
    grid.removeMeta(name);
    if (changed) grid.insertMeta(name, *changed);
}

void editVoxels(openvdb::FloatGrid& grid, ByteSource& bytes) {
    const auto coordinate = [&] {
        return bytes.byte() % 4 ? int(bytes.number<std::int8_t>()) : int(bytes.number<std::int32_t>());
    };
    const int x = coordinate(), y = coordinate(), z = coordinate();
    const float value = bytes.anyFloat();
    if (bytes.flag())
        grid.tree().addTile(1 + bytes.below(3), openvdb::Coord(x, y, z), value, bytes.flag());
    else
        grid.tree().setValue(openvdb::Coord(x, y, z), value);
}

}  // namespace

void checkVdb(Bytes file) {
    const std::filesystem::path path = scratch("fuzz.vdb");
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(file.data()), std::streamsize(file.size()));
    readAndUse(path);
}

void checkVdbEntries(Bytes edits) {
    static const LevelSet field = fieldWithBody();
    ByteSource bytes(edits);
    const openvdb::FloatGrid::Ptr grid = field.grids().distance->deepCopy();
    for (unsigned count = 1 + bytes.below(maxEntryEdits); count > 0; --count)
        bytes.byte() % 4 ? editEntry(*grid, bytes) : editVoxels(*grid, bytes);
    const std::filesystem::path path = scratch("entries.vdb");
    writeGrids(path, {grid, field.grids().points});
    readAndUse(path);
}

}  // namespace bilayer::test
