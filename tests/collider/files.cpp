// SPDX-License-Identifier: Apache-2.0
// Files with invalid entries: they are refused, or the result answers all queries safely.
#include <sys/resource.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include <bilayer/collider/mass.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/surface.h>
#include <bilayer/sdf/vdb_io.h>
#include "collider/contact/body/body.h"
#include "collider/contact/body/collider_data.h"
#include "demos/shared/shapes.h"
#include "sdf/base/access.h"
#include "sdf/base/openvdb_points.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::files_test {
using namespace bilayer::detail;
using namespace bilayer::test;

namespace {

using openvdb::Metadata;

const glm::vec3 half{0.4f, 0.3f, 0.2f};

LevelSet stored(bool withMesh = true) {
    const Mesh mesh = shapes::box(half, 2);
    const LevelSet plain = build(mesh, {.voxelSize = 0.1f});
    Body body = makeBody(mesh, plain, {});
    if (!withMesh) body.mesh.reset();
    return withBody(plain, body);
}

std::vector<Contact> contacts(const Collider& a, const Collider& b) {
    std::vector<Contact> found;
    collide(a, {}, b, {{0.1f, 0.59f, 0.05f}, {1, 0, 0, 0}}, {.margin = 0.05f}, found);
    return found;
}

// What a file answers: as many contacts, the same distances, sides and mass.
struct Answers {
    std::size_t contacts;
    double volume;
    std::vector<float> distances;

    explicit Answers(const Collider& collider)
        : contacts(files_test::contacts(collider, collider).size()), volume(collider.mass().volume) {
        for (const Field* field : {&collider.field(), &collider.exactField()})
            for (float y = -0.5f; y <= 0.5f; y += 0.125f)
                for (const glm::vec3 p : {glm::vec3(0.1f, y, 0), glm::vec3(0, y, 0.15f)}) {
                    distances.push_back(field->closest(p).distance);
                    distances.push_back(field->inside(p));
                }
    }
    // The volume may be any that the bounds and moments allow.
    bool isSame(const Answers& other, bool withVolume) const {
        return contacts == other.contacts && distances == other.distances && (!withVolume || volume == other.volume);
    }
};

// Queries that an accepted file must survive.
Answers askAll(const std::filesystem::path& path, std::optional<std::size_t> expected) {
    const LevelSet field = readVdb(path);
    const Body body = bodyOf(field);
    const Collider collider(field);
    const float least = std::min(half.y, field.voxelSize());
    for (const Field* asked : {&collider.field(), &collider.exactField()}) {
        REQUIRE(asked->inside({0, 0, 0}));
        REQUIRE_FALSE(asked->inside({0, 2, 0}));
        REQUIRE(asked->closest({0.1f, 0.5f, 0}).distance == Approx(0.2).margin(least));
        REQUIRE(asked->raycast({{0.1f, 5, 0}, {0, -1, 0}}));
        REQUIRE(asked->sphereCast({{0.1f, 5, 0}, {0, -1, 0}}, 0.1f));
        REQUIRE(asked->overlapsSphere({0, 0.5f, 0}, 0.35f));
        REQUIRE(asked->overlapsBox({{0, 0.5f, 0}, glm::vec3(0.35f)}));
    }
    const Answers answers(collider);
    if (expected) REQUIRE(answers.contacts == *expected);
    REQUIRE_FALSE(collider.mesh().triangles.empty());
    REQUIRE_FALSE(surface(field, {}).triangles.empty());
    REQUIRE(massProperties(field).volume > 0);
    return answers;
}

// Numbers that an entry must not have, and some that it may.
std::vector<double> extremes() {
    std::vector<double> values{std::numeric_limits<double>::quiet_NaN()};
    for (const double value : {0., 1e-45, 1e-30, 0.01, 0.1, 3., 1e15, 3.5e37, std::numeric_limits<double>::infinity()})
        values.insert(values.end(), {value, -value});
    return values;
}

template <class Vector>
void addVectors(const openvdb::TypedMetadata<Vector>& entry, std::vector<Metadata::Ptr>& changed) {
    for (const double value : extremes())
        for (const bool all : {false, true}) {
            Vector vector = entry.value();
            for (int k = 0; k < (all ? Vector::size : 1); ++k) vector[k] = typename Vector::value_type(value);
            changed.push_back(std::make_shared<openvdb::TypedMetadata<Vector>>(vector));
        }
}

template <class Value>
void addNumbers(std::vector<Metadata::Ptr>& changed) {
    for (const double value : extremes())
        changed.push_back(std::make_shared<openvdb::TypedMetadata<Value>>(Value(value)));
}

template <class Value>
void addIntegers(std::vector<Metadata::Ptr>& changed) {
    using Limits = std::numeric_limits<Value>;
    for (const Value value : {Limits::min(), Limits::max(), Value(-1), Value(0), Value(2)})
        changed.push_back(std::make_shared<openvdb::TypedMetadata<Value>>(value));
}

// The same entry with other values, of its own type and of another.
std::vector<Metadata::Ptr> changedEntries(const Metadata& entry) {
    std::vector<Metadata::Ptr> changed;
    for (const char* text : {"", "none"}) changed.push_back(std::make_shared<openvdb::StringMetadata>(text));
    const std::string type = entry.typeName();
    if (type == "float") addNumbers<float>(changed);
    if (type == "double") addNumbers<double>(changed);
    if (type == "int32") addIntegers<std::int32_t>(changed);
    if (type == "int64") addIntegers<std::int64_t>(changed);
    if (type == "vec3s") addVectors(static_cast<const openvdb::Vec3SMetadata&>(entry), changed);
    if (type == "vec4s") addVectors(static_cast<const openvdb::Vec4SMetadata&>(entry), changed);
    changed.push_back(std::make_shared<openvdb::FloatMetadata>(0.5f));
    return changed;
}

/// Peak memory of this process [bytes].
std::size_t peakMemory() {
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    return std::size_t(usage.ru_maxrss) * 1024;
}

void writeChanged(const std::filesystem::path& path, const Grids& grids,
                  const std::function<void(openvdb::FloatGrid&)>& change) {
    const auto distance = openvdb::ConstPtrCast<openvdb::FloatGrid>(grids.distance)->copy();
    change(*distance);
    writeGrids(path, {distance, grids.points});
}

}  // namespace

TEST_CASE("an entry of a file is refused by name, or the file answers as before, whatever the entry holds") {
    const auto path = scratch("entry.vdb");
    for (const bool withMesh : {true, false}) {
        const LevelSet field = stored(withMesh);
        writeVdb(path, field);
        const Answers expected = askAll(path, std::nullopt);
        REQUIRE(expected.contacts > 3);
        int refused = 0, accepted = 0;
        const auto check = [&](const std::string& name, const Metadata* value) {
            writeChanged(path, field.grids(), [&](openvdb::FloatGrid& copy) {
                copy.removeMeta(name);
                if (value) copy.insertMeta(name, *value);
            });
            CAPTURE(withMesh, name, value ? value->str().substr(0, 60) : "absent");
            std::string why;
            try {
                bodyOf(readVdb(path));
            } catch (const std::exception& error) {
                why = error.what();
            }
            why.empty() ? ++accepted : ++refused;
            if (why.empty()) {
                CHECK(askAll(path, expected.contacts).isSame(expected, name != "bilayer:volume"));
            } else if (value) {
                CHECK_THAT(why, Catch::Contains(name));
            }
        };
        const openvdb::FloatGrid& grid = *field.grids().distance;
        for (auto entry = grid.beginMeta(); entry != grid.endMeta(); ++entry) {
            // skips the entries that OpenVDB writes and reads itself
            if (!entry->first.starts_with("bilayer:")) continue;
            check(entry->first, nullptr);
            for (const Metadata::Ptr& changed : changedEntries(*entry->second)) check(entry->first, changed.get());
        }
        CAPTURE(refused, accepted);
        REQUIRE(refused > 200);
        REQUIRE(accepted > 1);
    }
}

TEST_CASE("whatever a field's widths, voxels and shift are, they are refused or the file is as good as before") {
    const auto path = scratch("grid.vdb");
    const LevelSet field = stored();
    const auto check = [&](const std::function<void(openvdb::FloatGrid&)>& change) {
        try {
            writeChanged(path, field.grids(), change);
            bodyOf(readVdb(path));
        } catch (const std::exception&) {
            return;
        }
        askAll(path, std::nullopt);
    };
    using openvdb::math::Transform;
    for (const double value : extremes()) {
        CAPTURE(value);
        check([&](openvdb::FloatGrid& grid) {
            const auto copy = grid.tree().copy();
            static_cast<openvdb::FloatTree&>(*copy).root().setBackground(float(value), false);
            grid.setTree(copy);
        });
        check([&](openvdb::FloatGrid& grid) {
            openvdb::math::Mat4d scale = openvdb::math::Mat4d::identity();
            for (int axis = 0; axis < 3; ++axis) scale[axis][axis] = value;
            grid.setTransform(Transform::createLinearTransform(scale));
        });
        check([&](openvdb::FloatGrid& grid) {
            const auto transform = grid.transform().copy();
            transform->postTranslate(openvdb::Vec3d(value, 0, 0));
            grid.setTransform(transform);
        });
        check([&](openvdb::FloatGrid& grid) {
            const auto copy = grid.deepCopy();
            copy->tree().beginLeaf()->setValueOn(7, float(value));
            if (std::abs(value) < 0.05 || std::abs(value) > 0.25) grid.setTree(copy->treePtr());
        });
        check([&](openvdb::FloatGrid& grid) {
            const auto copy = grid.deepCopy();
            copy->tree().addTile(2, openvdb::Coord(128), float(value), true);
            grid.setTree(copy->treePtr());
        });
    }
    for (const int far : {std::numeric_limits<int>::max(), std::numeric_limits<int>::min(), 1 << 20})
        check([&](openvdb::FloatGrid& grid) {
            const auto copy = grid.deepCopy();
            copy->tree().setValue(openvdb::Coord(far, 0, 0), 0.05f);
            grid.setTree(copy->treePtr());
        });
}

TEST_CASE("lengths in a file take no more memory than the file explains, whatever they are") {
    // the second seed shortens an attribute of points relative to the first
    const unsigned seed = GENERATE(test::seed(), 2968168663u);
    CAPTURE(seed);
    Random random(seed);
    const auto path = scratch("lengths.vdb");
    writeVdb(path, stored());
    constexpr std::size_t sealSize = 23, headSize = 3000;
    std::string whole = test::contentsOf(path);
    whole.resize(whole.size() - sealSize);  // like files of other programs
    std::ofstream(path, std::ios::binary) << whole;
    askAll(path, contacts(Collider(stored()), Collider(stored())).size());
    const std::size_t before = peakMemory();
    int accepted = 0;
    const auto write = [&](std::size_t at, std::uint64_t value, std::size_t size) {
        std::string wrong = whole;
        std::memcpy(wrong.data() + at, &value, std::min(size, wrong.size() - at));
        std::ofstream(path, std::ios::binary) << wrong;
        CAPTURE(at, value, size);
        try {
            (void)bodyOf(readVdb(path));  // a field allocates memory for its box
            ++accepted;
        } catch (const std::exception& error) {
            REQUIRE(std::strlen(error.what()) > 0);
        }
        REQUIRE(peakMemory() < before + (std::size_t(200) << 20));
    };
    for (std::size_t at = 0; at < std::min(headSize, whole.size()); at += 7) {
        write(at, 0xffff0019u, 4);
        write(at, 0x7fffffffu, 4);
    }
    for (int i = 0; i < 500; ++i) {
        const auto at = std::size_t(random(0, double(whole.size())));
        const std::uint64_t values[] = {0xffffffffu, 0x7fffffff, 0x80000000u, 0xfffffff0u, 0x10000000u,
                                        0xffff,      1,          0,           255,         std::uint64_t(1) << 63};
        write(at, values[std::size_t(random(0, 9.999))], i % 3 ? 4 : 8);
    }
    REQUIRE(accepted > 0);
}

TEST_CASE("what is written can be read, whatever the size of the body") {
    const auto path = scratch("size.vdb");
    for (const float size : {3e-4f, 1e-2f, 1.f, 1e4f, 1e7f, 1e10f, 1e13f}) {
        CAPTURE(size);
        const Mesh mesh{{{0, 0, 0}, {size, 0, 0}, {0, size, 0}, {0, 0, size}},
                        {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
        const LevelSet plain = build(mesh, {.voxelSize = size / 12});
        const Collider made(mesh, plain);
        writeVdb(path, withBody(plain, dataOf(made).body));
        const Collider read(readVdb(path));
        REQUIRE(dataOf(read).body.mass.has_value() == dataOf(made).body.mass.has_value());
        REQUIRE(dataOf(made).body.mass.has_value() == (size < 1e8f));
        if (dataOf(made).body.mass) REQUIRE(read.mass().volume == made.mass().volume);
        if (!dataOf(made).body.mass) REQUIRE_THROWS_WITH(made.mass(), Catch::Contains("single precision"));
    }
    const LevelSet field = stored();
    Body body = bodyOf(field);
    body.mass->inertia[0][0] = std::numeric_limits<float>::infinity();
    REQUIRE_THROWS_AS(withBody(field, body), std::invalid_argument);
}
}  // namespace bilayer::files_test
