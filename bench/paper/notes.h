// SPDX-License-Identifier: Apache-2.0
// Notes of rows where our time exceeds another's.
#pragma once

#include <string>
#include <vector>

#include "bench/paper/published.h"

namespace bilayer::paper {

/// The paper's times of a model in Tables 2 and 3. Throws std::logic_error for another model.
const published::Seconds& published23(const std::string& model);

/// "1 thread", "2 threads".
std::string counted(int count);

/// Notes a row where our time exceeds another's.
void note(std::vector<std::string>& found, const std::string& where, const std::string& what, double ours,
          const std::string& other, double theirs, const std::string& shown);
void note(std::vector<std::string>& found, const std::string& where, const std::string& what, double ours,
          const std::string& other, double theirs);

/// The same against a number of the paper's.
void notePapers(std::vector<std::string>& found, const std::string& where, const std::string& what, double ours,
                const std::string& papers, double theirs);

}  // namespace bilayer::paper
