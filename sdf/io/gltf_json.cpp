#include "sdf/io/gltf_json.h"

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

constexpr std::size_t longestQuote = 40;  // [bytes]
constexpr int maxNesting = 200;           // of objects and arrays; tinygltf recurses once per level

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
enum class Kind { Index, Size, Boolean, Text, AccessorType, Numbers, Indices, Texts, Indexed, Object, Objects };

struct Member {
    const char* name;
    Kind kind;
    bool isRequired = false;
    std::size_t count = 0;             ///< of Numbers; 0: any
    const char* each = "";             ///< singular name of Objects
    std::vector<Member> members = {};  ///< of an Object, or of each of Objects
};

// Section 5 of the glTF 2.0 specification, as far as it concerns the shape.
const std::vector<Member>& gltfMembers() {
    static const std::vector<Member> sparseIndices{
        {"bufferView", Kind::Index, true}, {"byteOffset", Kind::Index}, {"componentType", Kind::Index, true}};
    static const std::vector<Member> sparseValues{{"bufferView", Kind::Index, true}, {"byteOffset", Kind::Index}};
    static const std::vector<Member> sparse{{"count", Kind::Index, true},
                                            {"indices", Kind::Object, true, 0, "", sparseIndices},
                                            {"values", Kind::Object, true, 0, "", sparseValues}};
    static const std::vector<Member> accessor{{"bufferView", Kind::Index},
                                              {"byteOffset", Kind::Size},
                                              {"componentType", Kind::Index, true},
                                              {"normalized", Kind::Boolean},
                                              {"count", Kind::Size, true},
                                              {"type", Kind::AccessorType, true},
                                              {"sparse", Kind::Object, false, 0, "", sparse}};
    static const std::vector<Member> view{{"buffer", Kind::Index, true},
                                          {"byteOffset", Kind::Size},
                                          {"byteLength", Kind::Size, true},
                                          {"byteStride", Kind::Size}};
    static const std::vector<Member> node{{"mesh", Kind::Index},
                                          {"skin", Kind::Index},
                                          {"children", Kind::Indices},
                                          {"matrix", Kind::Numbers, false, 16},
                                          {"extensions", Kind::Object},
                                          {"translation", Kind::Numbers, false, 3},
                                          {"scale", Kind::Numbers, false, 3},
                                          {"rotation", Kind::Numbers, false, 4}};
    static const std::vector<Member> primitive{{"attributes", Kind::Indexed, true},
                                               {"indices", Kind::Index},
                                               {"mode", Kind::Index},
                                               {"extensions", Kind::Object}};
    static const std::vector<Member> mesh{{"primitives", Kind::Objects, true, 0, "primitive", primitive}};
    static const std::vector<Member> skin{{"joints", Kind::Indices}, {"inverseBindMatrices", Kind::Index}};
    static const std::vector<Member> gltf{
        {"asset", Kind::Object, true, 0, "", {{"version", Kind::Text, true}}},
        {"extensionsUsed", Kind::Texts},
        {"extensionsRequired", Kind::Texts},
        {"buffers", Kind::Objects, false, 0, "buffer", {{"byteLength", Kind::Size, true}, {"uri", Kind::Text}}},
        {"bufferViews", Kind::Objects, false, 0, "buffer view", view},
        {"accessors", Kind::Objects, false, 0, "accessor", accessor},
        {"meshes", Kind::Objects, false, 0, "mesh", mesh},
        {"skins", Kind::Objects, false, 0, "skin", skin},
        {"nodes", Kind::Objects, false, 0, "node", node},
        {"scene", Kind::Index},
        {"scenes", Kind::Objects, false, 0, "scene", {{"nodes", Kind::Indices}}}};
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

bool isOfKind(json& value, Kind kind) {
    switch (kind) {
        case Kind::Index:
            return takeIndex(value);
        case Kind::Size:
            return takeInteger(value, std::numeric_limits<std::uint64_t>::max());
        case Kind::Boolean:
            return value.is_boolean();
        case Kind::Text:
            return value.is_string();
        case Kind::AccessorType:
            return isAccessorType(value);
        case Kind::Numbers:
            return value.is_array() && allOf(value, [](const json& v) { return v.is_number(); });
        case Kind::Indices:
            return value.is_array() && allOf(value, takeIndex);
        case Kind::Texts:
            return value.is_array() && allOf(value, [](const json& v) { return v.is_string(); });
        case Kind::Indexed:
            return value.is_object() && allOf(value, takeIndex);
        case Kind::Object:
            return value.is_object();
        case Kind::Objects:
            return value.is_array() && allOf(value, [](const json& v) { return v.is_object(); });
    }
    return false;
}

std::string wanted(const Member& member) {
    switch (member.kind) {
        case Kind::Index:
            return fmt::format("an integer from 0 to {}", std::numeric_limits<int>::max());
        case Kind::Size:
            return "an integer that is not negative";
        case Kind::Boolean:
            return "true or false";
        case Kind::Text:
            return "a string";
        case Kind::AccessorType:
            return "SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4";
        case Kind::Numbers:
            return fmt::format("an array of {} numbers", member.count);
        case Kind::Indices:
            return "an array of integers that are not negative";
        case Kind::Texts:
            return "an array of strings";
        case Kind::Indexed:
            return "an object whose members are integers that are not negative";
        case Kind::Object:
            return "an object";
        case Kind::Objects:
            return "an array of objects";
    }
    return {};
}

void check(json& object, const std::vector<Member>& members, const std::string& of);

void check(json& value, const Member& member, const std::string& of) {
    if (!isOfKind(value, member.kind))
        throw std::runtime_error(
            fmt::format("the {} of {} is {}; it must be {}", member.name, of, excerpt(value.dump()), wanted(member)));
    if (member.count > 0 && value.size() != member.count)
        throw std::runtime_error(
            fmt::format("the {} of {} has {} numbers; it must have {}", member.name, of, value.size(), member.count));
    if (member.kind == Kind::Object) check(value, member.members, fmt::format("the {} of {}", member.name, of));
    if (member.kind != Kind::Objects) return;
    const std::string whole = of == "the file" ? "" : " of " + of;
    for (std::size_t i = 0; i < value.size(); ++i)
        check(value[i], member.members, fmt::format("{} {}{}", member.each, i, whole));
}

void check(json& object, const std::vector<Member>& members, const std::string& of) {
    for (const Member& member : members) {
        if (const auto found = object.find(member.name); found != object.end())
            check(*found, member, of);
        else if (member.isRequired)
            throw std::runtime_error(fmt::format("{} has no {}", of, member.name));
    }
}

}  // namespace

std::string excerpt(std::string_view text) {
    if (text.size() <= longestQuote) return std::string(text);
    std::size_t end = longestQuote;
    while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xc0) == 0x80) --end;  // inside a UTF-8 character
    return std::string(text.substr(0, end)) + " ...";
}

json parseGltf(std::string_view text) {
    json file = parse(text);
    if (!file.is_object()) throw std::runtime_error("its JSON is no object, as glTF's is");
    const auto isKnown = [](const std::string& name) {
        return std::any_of(gltfMembers().begin(), gltfMembers().end(),
                           [&](const Member& member) { return name == member.name; });
    };
    for (auto member = file.begin(); member != file.end();)
        member = isKnown(member.key()) ? std::next(member) : file.erase(member);
    check(file, gltfMembers(), "the file");
    return file;
}

}  // namespace bilayer::detail
