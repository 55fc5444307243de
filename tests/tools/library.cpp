// SPDX-License-Identifier: Apache-2.0
#include "tests/tools/library.h"

#include <chrono>
#include <fstream>
#include <sstream>
#include <thread>

#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "tests/support/support.h"

namespace bilayer::test {

namespace fs = std::filesystem;

fs::path emptyFolder(const std::string& name) {
    const fs::path path = scratch(name);
    fs::remove_all(path);
    fs::create_directories(path);
    return path;
}

fs::path boxLibrary(const std::string& name, int count) {
    const fs::path library = emptyFolder(name);
    for (const char* folder : {"a", "b"}) fs::create_directory(library / folder);
    for (int i = 0; i < count; ++i)
        writeMesh(library / (i % 2 ? "b" : "a") / (std::to_string(i) + ".ply"),
                  shapes::box({0.5f, 0.5f, 0.3f + 0.01f * float(i)}, 2));
    return library;
}

Words batchWords(const fs::path& library, const fs::path& output, const Words& options) {
    Words words{"batch", "--tree", library.string(), "-o", output.string(), "--voxel-size", "0.1", "--json"};
    words.insert(words.end(), options.begin(), options.end());
    return words;
}

std::map<std::string, nlohmann::json> recordsIn(const std::string& lines) {
    std::map<std::string, nlohmann::json> records;
    std::istringstream stream(lines);
    for (std::string line; std::getline(stream, line);) {
        const nlohmann::json record = nlohmann::json::parse(line);
        records[record.at("file")] = record;
    }
    return records;
}

namespace {

// OpenVDB's random identifier and the checksum of the file, which is therefore random too [bytes].
constexpr std::size_t identifierBegin = 21, identifierEnd = 57, checksumSize = 23;

std::string withoutIdentifier(const std::string& file) {
    if (file.size() < identifierEnd + checksumSize) return file;
    return file.substr(0, identifierBegin) + file.substr(identifierEnd, file.size() - identifierEnd - checksumSize);
}

}  // namespace

std::map<std::string, std::string> fieldsIn(const fs::path& folder) {
    std::map<std::string, std::string> fields;
    for (fs::recursive_directory_iterator entry(folder), end; entry != end; ++entry) {
        if (entry->path().filename() == ".bilayer")
            entry.disable_recursion_pending();
        else if (entry->is_regular_file())
            fields[entry->path().lexically_relative(folder).generic_string()] =
                withoutIdentifier(contents(entry->path()));
    }
    return fields;
}

std::vector<std::string> leftovers(const fs::path& output) {
    std::vector<std::string> found;
    for (const auto& entry : fs::recursive_directory_iterator(output / ".bilayer/work"))
        found.push_back(entry.path().string());
    return found;
}

std::vector<pid_t> childrenOf(pid_t process, std::size_t count) {
    const std::string id = std::to_string(process);
    for (int i = 0; i < 1000; ++i) {
        std::istringstream list(contents("/proc/" + id + "/task/" + id + "/children"));
        std::vector<pid_t> children;
        for (pid_t child = 0; list >> child;) children.push_back(child);
        if (children.size() >= count) return children;
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return {};
}

}  // namespace bilayer::test
