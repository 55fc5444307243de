// SPDX-License-Identifier: Apache-2.0
// The JSON of a glTF file: the parts that define the shape, with members of validated types; internal.
// Tested by tests/sdf/gltf_json.cpp through readScene().
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace bilayer::detail {

/// Quotes a text from a file for an error message, at most 40 bytes of it.
std::string excerpt(std::string_view text);

/// Parses the parts of a glTF file's JSON that define its shape: no materials, images, animations or cameras. Integers
/// that are written as 3.0 become integers.
///
/// Throws std::runtime_error, which does not name the file, in plain words. For invalid JSON it states line and column.
/// If a member is missing, or its type or length differs from section 5 of the glTF 2.0 specification, it names the
/// object and the member and quotes the actual value.
nlohmann::json parseGltf(std::string_view text);

}  // namespace bilayer::detail
