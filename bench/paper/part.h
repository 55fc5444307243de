// A part of the paper that is repeated: a table, a figure, a claim. Measuring gives JSON, which is kept from run to
// run; the page is written from what is kept.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace bilayer::paper {

/// What the parts are told.
struct Run {
    int rounds = 3;              ///< builders take turns so many times
    std::string meshes;          ///< folder of fetched meshes
    std::string pictures;        ///< folder that pictures are written to
    std::string picturesOnPage;  ///< the same, as seen from the page
};

struct Part {
    const char* name;   ///< on the command line: "table1"
    const char* title;  ///< on the page
    /// Runs the experiment. An object with "skipped" says why there is none.
    nlohmann::json (*measure)(const Run& run);
    /// Markdown of what measure() gave.
    std::string (*text)(const nlohmann::json& data);
    /// Sentences: where bilayer falls behind the paper, or behind a peer, in what measure() gave. May be null.
    std::vector<std::string> (*behind)(const nlohmann::json& data) = nullptr;
};

/// All, in the order of the page.
std::vector<Part> parts();

// In the files of the same names.
std::vector<Part> accuracyParts();  ///< same, table1, k
std::vector<Part> speedParts();     ///< table2 to table5
std::vector<Part> figureParts();    ///< figure7 to figure11
std::vector<Part> claimParts();     ///< theorems, walls

}  // namespace bilayer::paper
