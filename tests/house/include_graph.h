// SPDX-License-Identifier: Apache-2.0
// Which file of the project includes which.
#pragma once

#include <algorithm>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "tests/house/sources.h"

namespace bilayer::test {

/// An include line: <bilayer/PATH>, <PATH> or "PATH".
struct Include {
    std::string path;      ///< without "bilayer/"
    bool quoted = false;   ///< by "..."
    bool bilayer = false;  ///< written with "bilayer/"
};

/// The include of a line; its path is empty for other lines.
inline Include includeOf(const std::string& line) {
    static const std::regex pattern(R"re(^\s*#\s*include\s*(["<])(bilayer/)?([^">]+)[">])re");
    std::smatch match;
    if (!std::regex_search(line, match, pattern)) return {};
    return {match[3].str(), match[1] == "\"", match[2].matched};
}

/// Files with the project's files that each includes directly; paths are relative to the project.
using IncludeGraph = std::map<std::string, std::set<std::string>>;

/// The include graph of all C++ files of some folders.
inline IncludeGraph includeGraph(const std::vector<std::string>& folders) {
    IncludeGraph graph;
    for (const std::string& folder : folders)
        for (const std::string& file : codeIn(folder)) {
            std::set<std::string>& included = graph[file];
            std::ifstream stream(fs::path(BILAYER_SOURCES) / file);
            for (std::string line; std::getline(stream, line);)
                if (const Include include = includeOf(line); include.quoted || include.bilayer)
                    included.insert(include.path);
        }
    return graph;
}

/// The files that a file includes, directly or through others, and the file itself.
inline std::set<std::string> includedBy(const IncludeGraph& graph, const std::string& file) {
    std::set<std::string> found{file};
    std::vector<std::string> open{file};
    while (!open.empty()) {
        const auto node = graph.find(open.back());
        open.pop_back();
        if (node == graph.end()) continue;
        for (const std::string& next : node->second)
            if (found.insert(next).second) open.push_back(next);
    }
    return found;
}

/// The graph in which each header also leads to what the source files that implement it include: what its users may
/// call. X.cpp implements X.h; a source file without a header of its name implements those of its folder that it
/// includes.
inline IncludeGraph callGraph(const IncludeGraph& graph) {
    IncludeGraph calls = graph;
    for (const auto& [file, included] : graph) {
        if (!file.ends_with(".cpp")) continue;
        const std::string own = file.substr(0, file.size() - 4) + ".h", folder = file.substr(0, file.rfind('/') + 1);
        for (const std::string& header : graph.count(own) ? std::set{own} : included)
            if (header.substr(0, header.rfind('/') + 1) == folder && graph.count(header)) calls[header].insert(file);
    }
    return calls;
}

/// Files that include each other in a circle, from one of them back to itself; empty where there is none.
inline std::vector<std::string> findCycle(const IncludeGraph& graph) {
    std::map<std::string, bool> finished;  // false while its includes are being followed
    std::vector<std::string> path;
    const auto visit = [&](const auto& self, const std::string& file) -> bool {
        const auto node = graph.find(file);
        if (node == graph.end()) return false;
        path.push_back(file);
        const auto [state, first] = finished.emplace(file, false);
        if (!first) {
            if (!state->second) return true;
            path.pop_back();
            return false;
        }
        for (const std::string& next : node->second)
            if (self(self, next)) return true;
        finished[file] = true;
        path.pop_back();
        return false;
    };
    for (const auto& [file, ignored] : graph)
        if (visit(visit, file)) {
            path.erase(path.begin(), std::find(path.begin(), path.end(), path.back()));
            return path;
        }
    return {};
}

}  // namespace bilayer::test
