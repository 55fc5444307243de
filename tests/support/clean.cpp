// SPDX-License-Identifier: Apache-2.0
#include "tests/support/clean.h"

#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

namespace bilayer::test {
namespace {

std::vector<std::string> cells(const std::string& line) {
    std::vector<std::string> result;
    std::istringstream in(line);
    std::string cell;
    std::getline(in, cell, '|');  // before the first bar
    while (std::getline(in, cell, '|')) {
        const std::size_t begin = cell.find_first_not_of(' '), end = cell.find_last_not_of(' ');
        result.push_back(begin == std::string::npos ? "" : cell.substr(begin, end - begin + 1));
    }
    return result;
}

}  // namespace

std::vector<std::string> cleanMeshes() {
    std::ifstream table(std::filesystem::path(BILAYER_MESHES) / "SOURCES.md");
    std::vector<std::string> names, header;
    for (std::string line; std::getline(table, line);) {
        if (line.empty() || line.front() != '|') continue;
        const std::vector<std::string> row = cells(line);
        if (header.empty()) header = row;
        std::map<std::string, std::string> is;
        for (std::size_t i = 0; i < row.size() && i < header.size(); ++i) is[header[i]] = row[i];
        if (is["watertight?"] == "yes" && is["oriented?"] == "yes" && is["self-int. pairs"] == "0")
            names.push_back(is["file"]);
    }
    return names;
}

}  // namespace bilayer::test
