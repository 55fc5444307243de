// SPDX-License-Identifier: Apache-2.0
// Text records, mostly one per line, read in parallel; internal.
// Tested by tests/sdf/mesh_readers.cpp through readMesh().
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

/// Consecutive records, and the text that should contain exactly these.
struct TextRecords {
    Cursor text;
    std::size_t first, count;
};

/// Splits the next lines into parts, one record per line. Returns fewer records if the text ends before.
inline std::vector<TextRecords> linesOf(const Cursor& text, std::size_t count) {
    constexpr std::size_t partRecords = 1 << 12;
    std::vector<TextRecords> parts;
    const char* at = text.at;
    for (std::size_t first = 0; first < count && at != text.end; first += partRecords) {
        const std::size_t length = std::min(partRecords, count - first);
        const char* begin = at;
        for (std::size_t i = 0; i < length && at != text.end; ++i) {
            const void* end = std::memchr(at, '\n', std::size_t(text.end - at));
            at = end ? static_cast<const char*>(end) + 1 : text.end;
        }
        parts.push_back({{begin, at}, first, length});
    }
    return parts;
}

/// Reads records: in parallel if each is on a line of its own, otherwise sequentially.
/// @param text  advances past the records
/// @param read  read(Cursor& text, std::size_t first, std::size_t count) reads this count of records, advances past
///              them, and returns their contents. It throws std::runtime_error on an error in the text. Its result must
///              depend on the text only, however the text is split
/// @return the returned values, in the order of the records
template <class Read>
auto readRecords(Cursor& text, std::size_t count, Read read) {
    text.skipSpace();
    const std::vector<TextRecords> lines = linesOf(text, count);
    std::vector<decltype(read(text, std::size_t(0), count))> parts(lines.size());
    std::atomic<bool> asLines = lines.size() > 1;
    if (asLines) {
        inParallel(lines.size(), [&](std::size_t i) {
            if (!asLines) return;
            Cursor at = lines[i].text;
            try {
                parts[i] = read(at, lines[i].first, lines[i].count);
            } catch (const std::runtime_error&) {
                asLines = false;
            }
            at.skipSpace();
            // each part held what it should: together they equal the sequence that one reader would find
            if (!at.atEnd()) asLines = false;
        });
    }
    if (asLines) {
        text.at = lines.back().text.end;
    } else {
        parts.clear();
        parts.push_back(read(text, std::size_t(0), count));
    }
    return parts;
}

}  // namespace bilayer::detail
