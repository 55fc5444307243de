// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/scenes/gltf_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <vector>

namespace bilayer::detail {
namespace {

using nlohmann::json;

constexpr std::size_t maxQuoteBytes = 40;  // [bytes]
constexpr int maxNesting = 200;            // of objects and arrays; tinygltf recurses once per level

void checkNesting(std::string_view text) {
    int depth = 0;
    bool inString = false;
    for (std::size_t i = 0; i < text.size(); ++i) {
        const char c = text[i];
        if (inString && c == '\\') {
            ++i;
        } else if (c == '"') {
            inString = !inString;
        } else if (!inString) {
            depth += (c == '{' || c == '[') - (c == '}' || c == ']');
            if (depth > maxNesting)
                throw std::runtime_error(fmt::format("byte {} of its JSON is nested more than {} deep", i, maxNesting));
        }
    }
}

std::string placeOf(std::string_view text, std::size_t at) {
    const std::string_view before = text.substr(0, at);
    const auto line = 1 + std::count(before.begin(), before.end(), '\n');
    const std::size_t lineStart = before.rfind('\n') + 1;  // 0 on the first line
    return fmt::format("line {}, column {}", line, at - lineStart + 1);
}

// Extracts "invalid literal; expected string literal" from "[...] parse error at ...: syntax error while parsing object
// key - invalid literal; last read: '{''; expected string literal".
std::string reasonOf(const json::parse_error& error) {
    std::string text = error.what();
    if (const std::size_t dash = text.find(" - "); dash != std::string::npos) text.erase(0, dash + 3);
    if (const std::size_t read = text.find("; last read: "); read != std::string::npos) {
        const std::size_t expected = text.rfind("; expected ");
        text.erase(read, expected != std::string::npos && expected > read ? expected - read : std::string::npos);
    }
    const std::string_view anyValue = "'[', '{', or a literal";
    if (const std::size_t value = text.find(anyValue); value != std::string::npos)
        text.replace(value, anyValue.size(), "a value");
    return text;
}

std::string damage(std::string_view text, const json::parse_error& error) {
    const std::size_t at = std::min(std::max<std::size_t>(error.byte, 1) - 1, text.size());
    const std::string stands = at < text.size() ? fmt::format(", at {}", excerpt(text.substr(at))) : "";
    return fmt::format("{}: its JSON is damaged: {}{}", placeOf(text, at), reasonOf(error), stands);
}

// Describes a number beyond the range of doubles; the parser does not report its position.
std::string damage(std::string_view text, const json::out_of_range& error) {
    const std::string what = error.what();
    const std::size_t first = what.find('\'') + 1;
    const std::string number = what.substr(first, what.rfind('\'') - first);
    return fmt::format("{}: the number {} is too large", placeOf(text, std::min(text.find(number), text.size())),
                       excerpt(number));
}

json parse(std::string_view text) {
    checkNesting(text);
    try {
        return json::parse(text.begin(), text.end());
    } catch (const json::parse_error& error) {
        throw std::runtime_error(damage(text, error));
    } catch (const json::out_of_range& error) {
        throw std::runtime_error(damage(text, error));
    }
}

/// The type of a member.
enum class GltfMemberKind {
    Index,
    Size,
    Boolean,
    Text,
    AccessorType,
    Numbers,
    Indices,
    Texts,
    Indexed,
    Object,
    Objects
};

struct GltfMember {
    const char* name;
    GltfMemberKind kind;
    bool isRequired = false;
    std::size_t count = 0;                 ///< of Numbers; 0: any
    const char* each = "";                 ///< singular name of Objects
    std::vector<GltfMember> members = {};  ///< of an Object, or of each of Objects
};

// Section 5 of the glTF 2.0 specification, as far as it concerns the shape.
const std::vector<GltfMember>& gltfMembers() {
    static const std::vector<GltfMember> sparseIndices{{"bufferView", GltfMemberKind::Index, true},
                                                       {"byteOffset", GltfMemberKind::Index},
                                                       {"componentType", GltfMemberKind::Index, true}};
    static const std::vector<GltfMember> sparseValues{{"bufferView", GltfMemberKind::Index, true},
                                                      {"byteOffset", GltfMemberKind::Index}};
    static const std::vector<GltfMember> sparse{{"count", GltfMemberKind::Index, true},
                                                {"indices", GltfMemberKind::Object, true, 0, "", sparseIndices},
                                                {"values", GltfMemberKind::Object, true, 0, "", sparseValues}};
    static const std::vector<GltfMember> accessor{{"bufferView", GltfMemberKind::Index},
                                                  {"byteOffset", GltfMemberKind::Size},
                                                  {"componentType", GltfMemberKind::Index, true},
                                                  {"normalized", GltfMemberKind::Boolean},
                                                  {"count", GltfMemberKind::Size, true},
                                                  {"type", GltfMemberKind::AccessorType, true},
                                                  {"sparse", GltfMemberKind::Object, false, 0, "", sparse}};
    static const std::vector<GltfMember> view{{"buffer", GltfMemberKind::Index, true},
                                              {"byteOffset", GltfMemberKind::Size},
                                              {"byteLength", GltfMemberKind::Size, true},
                                              {"byteStride", GltfMemberKind::Size}};
    static const std::vector<GltfMember> node{{"mesh", GltfMemberKind::Index},
                                              {"skin", GltfMemberKind::Index},
                                              {"children", GltfMemberKind::Indices},
                                              {"matrix", GltfMemberKind::Numbers, false, 16},
                                              {"extensions", GltfMemberKind::Object},
                                              {"translation", GltfMemberKind::Numbers, false, 3},
                                              {"scale", GltfMemberKind::Numbers, false, 3},
                                              {"rotation", GltfMemberKind::Numbers, false, 4}};
    static const std::vector<GltfMember> primitive{{"attributes", GltfMemberKind::Indexed, true},
                                                   {"indices", GltfMemberKind::Index},
                                                   {"mode", GltfMemberKind::Index},
                                                   {"extensions", GltfMemberKind::Object}};
    static const std::vector<GltfMember> mesh{{"primitives", GltfMemberKind::Objects, true, 0, "primitive", primitive}};
    static const std::vector<GltfMember> skin{{"joints", GltfMemberKind::Indices},
                                              {"inverseBindMatrices", GltfMemberKind::Index}};
    static const std::vector<GltfMember> gltf{
        {"asset", GltfMemberKind::Object, true, 0, "", {{"version", GltfMemberKind::Text, true}}},
        {"extensionsUsed", GltfMemberKind::Texts},
        {"extensionsRequired", GltfMemberKind::Texts},
        {"buffers",
         GltfMemberKind::Objects,
         false,
         0,
         "buffer",
         {{"byteLength", GltfMemberKind::Size, true}, {"uri", GltfMemberKind::Text}}},
        {"bufferViews", GltfMemberKind::Objects, false, 0, "buffer view", view},
        {"accessors", GltfMemberKind::Objects, false, 0, "accessor", accessor},
        {"meshes", GltfMemberKind::Objects, false, 0, "mesh", mesh},
        {"skins", GltfMemberKind::Objects, false, 0, "skin", skin},
        {"nodes", GltfMemberKind::Objects, false, 0, "node", node},
        {"scene", GltfMemberKind::Index},
        {"scenes", GltfMemberKind::Objects, false, 0, "scene", {{"nodes", GltfMemberKind::Indices}}}};
    return gltf;
}

// Accepts an integer of at most `max`, even if it is written as 3.0.
bool takeInteger(json& value, std::uint64_t max) {
    constexpr double exact = 9007199254740992;  // 2^53
    if (value.is_number_float()) {
        const double number = value.get<double>();
        if (number >= 0 && number <= exact && number == std::floor(number)) value = std::uint64_t(number);
    }
    return value.is_number_unsigned() && value.get<std::uint64_t>() <= max;
}

bool takeIndex(json& value) {
    return takeInteger(value, std::numeric_limits<int>::max());
}

template <class Test>
bool allOf(json& values, Test&& test) {
    return std::all_of(values.begin(), values.end(), test);
}

bool isAccessorType(const json& value) {
    constexpr const char* types[] = {"SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"};
    return std::any_of(std::begin(types), std::end(types), [&](const char* type) { return value == type; });
}

bool isOfKind(json& value, GltfMemberKind kind) {
    switch (kind) {
        case GltfMemberKind::Index:
            return takeIndex(value);
        case GltfMemberKind::Size:
            return takeInteger(value, std::numeric_limits<std::uint64_t>::max());
        case GltfMemberKind::Boolean:
            return value.is_boolean();
        case GltfMemberKind::Text:
            return value.is_string();
        case GltfMemberKind::AccessorType:
            return isAccessorType(value);
        case GltfMemberKind::Numbers:
            return value.is_array() && allOf(value, [](const json& v) { return v.is_number(); });
        case GltfMemberKind::Indices:
            return value.is_array() && allOf(value, takeIndex);
        case GltfMemberKind::Texts:
            return value.is_array() && allOf(value, [](const json& v) { return v.is_string(); });
        case GltfMemberKind::Indexed:
            return value.is_object() && allOf(value, takeIndex);
        case GltfMemberKind::Object:
            return value.is_object();
        case GltfMemberKind::Objects:
            return value.is_array() && allOf(value, [](const json& v) { return v.is_object(); });
    }
    return false;
}

std::string wanted(const GltfMember& member) {
    switch (member.kind) {
        case GltfMemberKind::Index:
            return fmt::format("an integer from 0 to {}", std::numeric_limits<int>::max());
        case GltfMemberKind::Size:
            return "an integer that is not negative";
        case GltfMemberKind::Boolean:
            return "true or false";
        case GltfMemberKind::Text:
            return "a string";
        case GltfMemberKind::AccessorType:
            return "SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4";
        case GltfMemberKind::Numbers:
            return fmt::format("an array of {} numbers", member.count);
        case GltfMemberKind::Indices:
            return "an array of integers that are not negative";
        case GltfMemberKind::Texts:
            return "an array of strings";
        case GltfMemberKind::Indexed:
            return "an object whose members are integers that are not negative";
        case GltfMemberKind::Object:
            return "an object";
        case GltfMemberKind::Objects:
            return "an array of objects";
    }
    return {};
}

void check(json& object, const std::vector<GltfMember>& members, const std::string& of);

void check(json& value, const GltfMember& member, const std::string& of) {
    if (!isOfKind(value, member.kind))
        throw std::runtime_error(
            fmt::format("the {} of {} is {}; it must be {}", member.name, of, excerpt(value.dump()), wanted(member)));
    if (member.count > 0 && value.size() != member.count)
        throw std::runtime_error(
            fmt::format("the {} of {} has {} numbers; it must have {}", member.name, of, value.size(), member.count));
    if (member.kind == GltfMemberKind::Object)
        check(value, member.members, fmt::format("the {} of {}", member.name, of));
    if (member.kind != GltfMemberKind::Objects) return;
    const std::string whole = of == "the file" ? "" : " of " + of;
    for (std::size_t i = 0; i < value.size(); ++i)
        check(value[i], member.members, fmt::format("{} {}{}", member.each, i, whole));
}

void check(json& object, const std::vector<GltfMember>& members, const std::string& of) {
    for (const GltfMember& member : members) {
        if (const auto found = object.find(member.name); found != object.end())
            check(*found, member, of);
        else if (member.isRequired)
            throw std::runtime_error(fmt::format("{} has no {}", of, member.name));
    }
}

}  // namespace

std::string excerpt(std::string_view text) {
    if (text.size() <= maxQuoteBytes) return std::string(text);
    std::size_t end = maxQuoteBytes;
    while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xc0) == 0x80) --end;  // inside a UTF-8 character
    return std::string(text.substr(0, end)) + " ...";
}

json parseGltf(std::string_view text) {
    json file = parse(text);
    if (!file.is_object()) throw std::runtime_error("its JSON is no object, as glTF's is");
    const auto isKnown = [](const std::string& name) {
        return std::any_of(gltfMembers().begin(), gltfMembers().end(),
                           [&](const GltfMember& member) { return name == member.name; });
    };
    for (auto member = file.begin(); member != file.end();)
        member = isKnown(member.key()) ? std::next(member) : file.erase(member);
    check(file, gltfMembers(), "the file");
    return file;
}

}  // namespace bilayer::detail
