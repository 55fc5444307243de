// SPDX-License-Identifier: Apache-2.0
// Shares of a batch for several machines.
// Tested by tests/tools/batch.cpp through the program.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace bilayer::tools {

/// One of `count` disjoint shares of a library, which together are complete. A mesh belongs to a shard by the hash of
/// its name alone, so that adding meshes moves no others.
struct Shard {
    std::uint32_t index = 1;  ///< 1..count
    std::uint32_t count = 1;

    bool contains(std::string_view name) const;
    std::string text() const;  ///< "2/8"
};

/// Parses "2/8". Throws CLI::ValidationError that names `option`.
Shard parseShard(const std::string& text, const std::string& option);

/// Returns the shard of a Slurm array task by its environment variables; nothing outside of array jobs. Throws
/// CLI::ValidationError if the array's task ids are not evenly spaced.
std::optional<Shard> slurmShard();

}  // namespace bilayer::tools
