// The JSON of a glTF file: its parts that make the shape, with members of the right types; internal.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace bilayer::detail {

/// What stands in a file, for an error: at most 40 bytes of it.
std::string excerpt(std::string_view text);

/// The parts of the JSON of a glTF file that make its shape: no materials, images, animations, cameras. Throws
/// std::runtime_error, which does not name the file, in plain words: line and column where the text is no JSON; the
/// object, its member and what stands there where a member is missing or of another type or length than section 5 of
/// the glTF 2.0 specification says. Integers that are written as 3.0 become integers.
nlohmann::json parseGltf(std::string_view text);

}  // namespace bilayer::detail
