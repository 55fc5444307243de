// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/shard.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cstdlib>

#include "sdf/io/content_hash.h"

namespace bilayer::tools {
namespace {

std::optional<std::uint32_t> wholeNumber(std::string_view text) {
    std::uint32_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return value;
}

// Throws if the environment variable is set to something other than a number.
std::optional<std::uint32_t> variable(const char* name) {
    const char* text = std::getenv(name);
    if (!text) return std::nullopt;
    const auto value = wholeNumber(text);
    if (!value) throw CLI::ValidationError(name, fmt::format("is '{}'; it must be a whole number", text));
    return value;
}

}  // namespace

bool Shard::contains(std::string_view name) const {
    return detail::contentHash(name) % count == index - 1;
}

std::string Shard::text() const {
    return fmt::format("{}/{}", index, count);
}

Shard parseShard(const std::string& text, const std::string& option) {
    const std::size_t slash = text.find('/');
    if (slash != std::string::npos) {
        const auto index = wholeNumber(std::string_view(text).substr(0, slash));
        const auto count = wholeNumber(std::string_view(text).substr(slash + 1));
        if (index && count && *index >= 1 && *index <= *count) return {*index, *count};
    }
    throw CLI::ValidationError(option, fmt::format("'{}' must be I/N, with I in 1..N", text));
}

std::optional<Shard> slurmShard() {
    const auto id = variable("SLURM_ARRAY_TASK_ID"), count = variable("SLURM_ARRAY_TASK_COUNT"),
               min = variable("SLURM_ARRAY_TASK_MIN"), max = variable("SLURM_ARRAY_TASK_MAX");
    if (!id) return std::nullopt;
    if (!count || !min || !max)
        throw CLI::ValidationError("SLURM_ARRAY_TASK_ID",
                                   "is set, but SLURM_ARRAY_TASK_COUNT, _MIN or _MAX is not: give --shard");
    const std::uint32_t gaps = *count - 1, range = *max - *min;
    const bool isEven = *count >= 1 && *id >= *min && *id <= *max && (gaps == 0 ? range == 0 : range % gaps == 0) &&
                        (range == 0 || (*id - *min) % (range / gaps) == 0);
    if (!isEven)
        throw CLI::ValidationError("SLURM_ARRAY_TASK_ID", "the array's task ids are not evenly spaced: give --shard");
    return Shard{range == 0 ? 1 : (*id - *min) / (range / gaps) + 1, *count};
}

}  // namespace bilayer::tools
