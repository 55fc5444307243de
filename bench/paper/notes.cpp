// SPDX-License-Identifier: Apache-2.0
#include "bench/paper/notes.h"

#include <fmt/format.h>

#include <stdexcept>

#include "bench/paper/markdown.h"

namespace bilayer::paper {

const published::Seconds& published23(const std::string& model) {
    for (const published::Seconds& paper : published::tables23)
        if (model == paper.model) return paper;
    throw std::logic_error("not in the paper: " + model);
}

std::string counted(int count) {
    return count == 1 ? "1 thread" : fmt::format("{} threads", count);
}

void note(std::vector<std::string>& found, const std::string& where, const std::string& what, double ours,
          const std::string& other, double theirs, const std::string& shown) {
    if (ours > theirs) found.push_back(fmt::format("{}: {} {} s, {} {} s.", where, what, digits(ours), other, shown));
}

void note(std::vector<std::string>& found, const std::string& where, const std::string& what, double ours,
          const std::string& other, double theirs) {
    note(found, where, what, ours, other, theirs, digits(theirs));
}

void notePapers(std::vector<std::string>& found, const std::string& where, const std::string& what, double ours,
                const std::string& papers, double theirs) {
    note(found, where, what, ours, fmt::format("the paper's {} on a {}", papers, published::processor), theirs,
         printed(theirs));
}

}  // namespace bilayer::paper
