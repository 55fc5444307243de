// SPDX-License-Identifier: Apache-2.0
// The files of a box from 0 to 1, 2 and 3 in all formats, for tests of the readers.
#pragma once

#include <filesystem>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

namespace bilayer::test {

extern const std::vector<glm::dvec3> boxPoints;
extern const std::vector<std::vector<int>> boxFaces;  ///< quadrilaterals

/// Writes a file into the scratch folder.
std::filesystem::path write(const std::string& name, const std::string& bytes);

/// Checks that a file holds the box, with its lower corner at `corner`.
void checkBox(const std::filesystem::path& path, const glm::dvec3& corner = glm::dvec3(0));

/// @param vertex   format of a line
/// @param texture  what follows each index
std::string objOfBox(const std::string& vertex = "v {} {} {}\n", const std::string& texture = "");

/// The facets of text STL, without the lines around them.
std::string stlOfBox(const std::string& normal = "0 0 0");
/// @param header  padded to 80 bytes
std::string binaryStlOfBox(const std::string& header);

struct PlyStyle {
    std::string format = "ascii", coordinate = "float", count = "uchar", index = "int", end = "\n";
    bool facesFirst = false, more = false;
};

/// With `more`, unused properties and elements stand before, between and after the used ones.
std::string plyOfBox(const PlyStyle& style);

std::string offOfBox(const std::string& keyword, const std::string& behindVertex, const std::string& behindFace,
                     const std::string& counts = "8 6 12\n", const std::string& blank = " ");

/// The text with all `what` replaced by `by`.
std::string replaced(std::string text, const std::string& what, const std::string& by);

/// @param mark  begin with a byte order mark
std::string utf16(const std::string& text, bool little, bool mark);

}  // namespace bilayer::test
