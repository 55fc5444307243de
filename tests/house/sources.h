// SPDX-License-Identifier: Apache-2.0
// The source files of the project, for tests of what stands in them.
#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace bilayer::test {

namespace fs = std::filesystem;

/// The private folders of a library from the bottom layer up: none may include a later one.
inline const std::map<std::string, std::vector<std::string>> floors{
    {"sdf",
     {"base", "leaf", "bvh", "mesh", "sign", "fill", "io", "io/polygon", "io/formats", "io/scenes", "io/vdb", "grid",
      "tiles"}},
    {"collider",
     {"field/layout", "field/triangles", "field/samples", "field/zero", "field/queries", "field/tiled",
      "contact/reduction", "contact/body", "contact/shapes", "contact/distance", "contact/search",
      "contact/open_surface", "contact/impact", "contact"}},
    {"cl", {"detail", "kernels"}},
    {"integration/bullet", {"detail"}},
    {"integration/fluid", {"detail"}},
};

/// The lowest private folder that may include a public header, for its types. No private folder may include a public
/// header that is not listed.
inline const std::map<std::string, std::string> publicFloors{
    {"sdf/options.h", "base"},
    {"sdf/mesh.h", "base"},
    {"sdf/level_set.h", "base"},
    {"sdf/grids.h", "base"},
    {"sdf/mesh_io.h", "io"},
    {"sdf/inspect.h", "mesh"},
    {"collider/query.h", "field/layout"},
    {"collider/pose.h", "field/layout"},
    {"collider/mass.h", "field/layout"},
    {"collider/field.h", "field/layout"},
    {"collider/collider.h", "contact/reduction"},
    {"collider/shapes.h", "contact/reduction"},
    {"collider/contact.h", "contact/reduction"},
    {"collider/distance.h", "contact/reduction"},
    {"cl/device.h", "detail"},
    {"cl/filler.h", "detail"},
    {"integration/bullet/shape.h", "detail"},
    {"integration/bullet/dispatcher.h", "detail"},
    {"integration/fluid/seed.h", "detail"},
};

inline const std::vector<std::string> folders{"sdf",   "cl",    "collider", "integration",
                                              "tools", "demos", "bench",    "tests"};

inline bool isSource(const fs::path& path) {
    static const std::set<std::string> extensions{".h",  ".cpp", ".cl",   ".py",    ".pyi",
                                                  ".sh", ".js",  ".html", ".cmake", ".txt"};
    return extensions.count(path.extension().string()) > 0;
}

/// Calls visit(path, line number, line) for each line of all source files; paths are relative to the project.
template <class Visit>
void eachLine(Visit visit) {
    const fs::path root = BILAYER_SOURCES;
    for (const std::string& folder : folders) {
        if (!fs::exists(root / folder)) continue;
        for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
            if (!entry.is_regular_file() || !isSource(entry.path())) continue;
            std::ifstream stream(entry.path());
            const std::string name = fs::relative(entry.path(), root).generic_string();
            std::string line;
            for (int number = 1; std::getline(stream, line); ++number) visit(name, number, line);
        }
    }
}

/// The contents of a file of the project.
inline std::string contents(const std::string& path) {
    std::ifstream stream(fs::path(BILAYER_SOURCES) / path);
    return std::string(std::istreambuf_iterator<char>(stream), {});
}

/// The C++ files of a folder and its subfolders, in order.
inline std::set<std::string> codeIn(const std::string& folder) {
    const fs::path root = BILAYER_SOURCES;
    std::set<std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(root / folder))
        if (entry.path().extension() == ".h" || entry.path().extension() == ".cpp")
            files.insert(fs::relative(entry.path(), root).generic_string());
    return files;
}

}  // namespace bilayer::test
