// Records of a text that mostly stand on a line each, read in parallel; internal.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "sdf/base/parallel_parts.h"
#include "sdf/io/text_source.h"

namespace bilayer::detail {

/// A run of records, and the text that should hold nothing else.
struct TextRecords {
    Cursor text;
    std::size_t first, count;
};

/// Cuts off the next lines, a record each, into runs. Fewer where the text ends before.
inline std::vector<TextRecords> linesOf(const Cursor& text, std::size_t count) {
    constexpr std::size_t runLength = 1 << 12;
    std::vector<TextRecords> runs;
    const char* at = text.at;
    for (std::size_t first = 0; first < count && at != text.end; first += runLength) {
        const std::size_t length = std::min(runLength, count - first);
        const char* begin = at;
        for (std::size_t i = 0; i < length && at != text.end; ++i) {
            const void* end = std::memchr(at, '\n', std::size_t(text.end - at));
            at = end ? static_cast<const char*>(end) + 1 : text.end;
        }
        runs.push_back({{begin, at}, first, length});
    }
    return runs;
}

/// Reads records, in parallel if each stands on a line of its own, else one after the other.
/// @param text  moves behind them
/// @param read  read(Cursor& text, std::size_t first, std::size_t count) reads so many records, moves behind them, and
///              returns what they hold; throws std::runtime_error where the text is at fault. Of the same text it must
///              make the same, however it is cut
/// @return what it returned, in the order of the records
template <class Read>
auto readRecords(Cursor& text, std::size_t count, Read read) {
    text.skipSpace();
    const std::vector<TextRecords> runs = linesOf(text, count);
    std::vector<decltype(read(text, std::size_t(0), count))> parts(runs.size());
    std::atomic<bool> asLines = runs.size() > 1;
    if (asLines) {
        inOrder(runs.size(), [&](std::size_t i) {
            if (!asLines) return;
            Cursor at = runs[i].text;
            try {
                parts[i] = read(at, runs[i].first, runs[i].count);
            } catch (const std::runtime_error&) {
                asLines = false;
            }
            at.skipSpace();
            // each run held what it should: together they are the sequence of records that one reader would find
            if (!at.atEnd()) asLines = false;
        });
    }
    if (asLines) {
        text.at = runs.back().text.end;
    } else {
        parts.clear();
        parts.push_back(read(text, std::size_t(0), count));
    }
    return parts;
}

}  // namespace bilayer::detail
