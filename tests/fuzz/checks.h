// SPDX-License-Identifier: Apache-2.0
// Checks of the libraries for arbitrary bytes. Each makes its input of the bytes and throws WrongAnswer if an answer is
// wrong. libFuzzer runs them with sanitizers (./run fuzz); replay.cpp runs them in the ordinary tests.
#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace bilayer::test {

using Bytes = std::span<const std::uint8_t>;

/// A result that the libraries must not give. It derives from no standard error, so that no check takes it for a
/// refusal.
class WrongAnswer : public std::exception {
  public:
    explicit WrongAnswer(std::string what) : what_(std::move(what)) {}
    const char* what() const noexcept override { return what_.c_str(); }

  private:
    std::string what_;
};

inline void require(bool holds, const std::string& what) {
    if (!holds) throw WrongAnswer(what);
}

/// Throws WrongAnswer if the text of an error is not one line of printable characters, or longer than 1000 bytes.
void requirePlainError(const std::string& text);

/// A check, and inputs to start from.
struct FuzzCheck {
    const char* name;
    std::size_t maxSize;  ///< of an input [bytes]
    void (*run)(Bytes input);
    std::vector<std::string> (*seeds)();
    std::vector<std::string> words{};  ///< that inputs often contain, for mutations
};

/// All checks, the most valuable first.
const std::vector<FuzzCheck>& fuzzChecks();

void checkObj(Bytes file);
void checkPly(Bytes file);
void checkStl(Bytes file);
void checkOff(Bytes file);
void checkRaw(Bytes file);
void checkGltf(Bytes file);
/// A file in one of Assimp's formats, which the first byte chooses.
void checkScenes(Bytes file);
/// The conversion of a structured scene of Assimp's, and edited answers of the process that reads it.
void checkSceneParts(Bytes recipe);
/// Reports on a structured mesh against counts over all edges, and against the same mesh in another order.
void checkInspect(Bytes recipe);
/// Exact and pseudonormal fields of a structured mesh against distances in double precision and winding numbers.
void checkBuild(Bytes recipe);
/// Reads a .vdb file, with its body, and queries it.
void checkVdb(Bytes file);
/// The same for a valid file of which metadata entries and values are edited.
void checkVdbEntries(Bytes edits);
/// Opens a field in tiles of which the manifest and the lists of surface blocks are edited, and queries it.
void checkTiles(Bytes edits);
/// Queries, rays and casts with arbitrary floats.
void checkQueries(Bytes numbers);
/// collide(), distance() and timeOfImpact() for arbitrary poses and scales.
void checkContacts(Bytes numbers);
/// rebuild() after arbitrary edits against a full build.
void checkRebuild(Bytes recipe);

}  // namespace bilayer::test
