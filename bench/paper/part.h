// SPDX-License-Identifier: Apache-2.0
// A reproduced part of the paper: a table, a figure or a claim. Measuring produces JSON, which is kept between runs;
// the page is written from the kept JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace bilayer::paper {

/// Options of all parts.
struct Run {
    int rounds = 3;              ///< timing rounds, in each of which every builder runs once
    std::string meshes;          ///< folder of downloaded meshes
    std::string pictures;        ///< output folder of the pictures
    std::string picturesOnPage;  ///< the same, relative to the page
};

struct Part {
    const char* name;   ///< on the command line: "table1"
    const char* title;  ///< on the page
    /// Runs the experiment. If it cannot run, the object has a "skipped" member with the reason.
    nlohmann::json (*measure)(const Run& run);
    /// Markdown of the result of measure().
    std::string (*text)(const nlohmann::json& data);
    /// Sentences about results of measure() where bilayer is worse than the paper or a peer. May be null.
    std::vector<std::string> (*behind)(const nlohmann::json& data) = nullptr;
};

/// All parts, in the order of the page.
std::vector<Part> parts();

// Each part is in the file of its name; figures and claims stand together.
Part same();
Part table1();
Part table2();
Part table3();
Part table4();
Part table5();
Part k();
std::vector<Part> figureParts();  ///< figure7 to figure11
std::vector<Part> claimParts();   ///< theorems, walls

}  // namespace bilayer::paper
