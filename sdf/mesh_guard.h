// Guards in front of Assimp 5.2, which crashes on some mesh files that end early and reads others wrong without a word.
#pragma once

#include <filesystem>
#include <string>

namespace bilayer {

/// Throws std::runtime_error that names the file if a .ply file holds less than its header announces, uses a vertex
/// that it does not have, or stores its faces as triangle strips (of which Assimp reads none, or one).
void guardPly(const std::filesystem::path& path);

/// Throws likewise if an ASCII .stl file ends before its `endsolid`. Assimp itself refuses binary ones that end early.
void guardStl(const std::filesystem::path& path);

/// The text of an .off file for Assimp: without comments and empty lines, for each of which it would lose a face at the
/// end, and with the counts on a line of their own. Throws as above if lines are missing or a face uses a vertex that
/// is not there.
std::string guardedOff(const std::filesystem::path& path);

}  // namespace bilayer
