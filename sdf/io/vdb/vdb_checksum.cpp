// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/vdb/vdb_checksum.h"

#include <fmt/format.h>
#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_reduce.h>
#include <zlib.h>

#include <algorithm>
#include <cstddef>
#include <stdexcept>

namespace bilayer::detail {
namespace {

constexpr std::string_view lineStart = "bilayer crc32 ";
constexpr std::size_t lineSize = lineStart.size() + 9;  // eight digits and a line feed
// A truncated file ends with a prefix of the checksum line. A prefix of at least this length is no coincidence; a file
// that ends with a shorter one still has all of its grids.
constexpr std::size_t minPrefix = 4;
constexpr std::size_t waitingBytes = 1 << 18;

std::string lineOf(uLong sum) {
    return fmt::format("{}{:08x}\n", lineStart, sum);
}

}  // namespace

// Computed on all threads: checksums of parts combine.
std::string checksumLine(std::string_view bytes) {
    struct Sum {
        uLong value = crc32(0, nullptr, 0);
        std::size_t size = 0;
    };
    constexpr std::size_t grain = 1 << 18;
    const auto add = [&](const tbb::blocked_range<std::size_t>& range, Sum sum) {
        sum.value = crc32_z(sum.value, reinterpret_cast<const Bytef*>(bytes.data()) + range.begin(), range.size());
        sum.size += range.size();
        return sum;
    };
    const auto join = [](const Sum& a, const Sum& b) {
        return Sum{crc32_combine(a.value, b.value, z_off_t(b.size)), a.size + b.size};
    };
    const Sum sum = tbb::parallel_reduce(tbb::blocked_range<std::size_t>(0, bytes.size(), grain), Sum{}, add, join);
    return lineOf(sum.value);
}

ChecksumBuffer::ChecksumBuffer(std::streambuf& to) : to_(to), waiting_(waitingBytes), sum_(crc32(0, nullptr, 0)) {
    setp(waiting_.data(), waiting_.data() + waiting_.size());
}

int ChecksumBuffer::sync() {
    const std::streamsize count = pptr() - pbase();
    sum_ = crc32_z(sum_, reinterpret_cast<const Bytef*>(pbase()), z_size_t(count));
    const bool isWritten = to_.sputn(pbase(), count) == count;
    setp(waiting_.data(), waiting_.data() + waiting_.size());
    return isWritten ? 0 : -1;
}

ChecksumBuffer::int_type ChecksumBuffer::overflow(int_type c) {
    if (sync() != 0) return traits_type::eof();
    if (!traits_type::eq_int_type(c, traits_type::eof())) sputc(traits_type::to_char_type(c));
    return traits_type::not_eof(c);
}

std::string ChecksumBuffer::line() {
    if (sync() != 0) throw std::runtime_error("cannot be written");
    return lineOf(sum_);
}

void requireChecksum(std::string_view file) {
    // Longer than the checksum line, because other bytes may follow it.
    const std::string_view end = file.substr(file.size() - std::min(file.size(), 4 * lineSize));
    for (std::size_t kept = lineStart.size() - 1; kept >= minPrefix; --kept)
        if (end.ends_with(lineStart.substr(0, kept))) throw std::runtime_error("its end is missing");
    const std::size_t at = end.rfind(lineStart);
    if (at == std::string_view::npos) return;
    if (checksumLine(file.substr(0, file.size() - end.size() + at)) != end.substr(at))
        throw std::runtime_error("its data do not match its checksum");
}

}  // namespace bilayer::detail
