// SPDX-License-Identifier: Apache-2.0
// Random damage of the bytes of a file.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <random>
#include <string>
#include <utility>
#include <vector>

namespace bilayer::test {

class Damage {
  public:
    /// @param words  of the file's format, which some changes insert
    explicit Damage(unsigned seed, std::vector<std::string> words = {}) : engine_(seed), words_(std::move(words)) {}

    std::size_t below(std::size_t count) { return std::uniform_int_distribution<std::size_t>(0, count - 1)(engine_); }

    /// Applies one to four changes, each of a random kind.
    std::string of(std::string bytes) {
        for (std::size_t changes = 1 + below(4); changes > 0; --changes) change(bytes);
        return bytes;
    }

  private:
    void change(std::string& bytes) {
        if (bytes.empty()) bytes.push_back('x');
        const std::size_t at = below(bytes.size()), length = 1 + below(std::min<std::size_t>(bytes.size() - at, 40));
        switch (below(words_.empty() ? 8 : 10)) {
            case 0:
                bytes[at] = char(bytes[at] ^ (1 << below(8)));
                break;
            case 1:
                bytes[at] = char(below(256));
                break;
            case 2:
                bytes.resize(at);
                break;
            case 3:
                bytes.erase(at, length);
                break;
            case 4:
                bytes.insert(at, bytes.substr(at, length));
                break;
            case 5:
                overwrite(bytes, at, oddNumber());
                break;
            case 6:
                replaceNumber(bytes, at);
                break;
            case 7:
                bytes.insert(at, noise(length));
                break;
            default:
                bytes.insert(at, words_[below(words_.size())]);
                break;
        }
    }

    static std::string spliced(const std::string& bytes, std::size_t at, std::size_t removed,
                               const std::string& added) {
        return bytes.substr(0, at) + added + bytes.substr(at + removed);
    }

    static void overwrite(std::string& bytes, std::size_t at, std::uint32_t number) {
        for (std::size_t k = 0; k < 4 && at + k < bytes.size(); ++k) bytes[at + k] = char(number >> (8 * k));
    }

    std::uint32_t oddNumber() {
        constexpr std::uint32_t numbers[]{0, 1, 2, 255, 65535, 65536, 0x7fffffff, 0x80000000, 0xffffffff, 0x7fc00000};
        return below(2) ? numbers[below(std::size(numbers))] : std::uint32_t(below(300));
    }

    // Replaces the first number in the text from this position on.
    void replaceNumber(std::string& bytes, std::size_t at) {
        constexpr const char* numbers[]{"",    "-1",          "0",   "1e999", "nan",  "99999999999999999999",
                                        "255", "-2147483649", "0x1", "1e",    "\"\"", "4294967295"};
        const std::size_t first = bytes.find_first_of("0123456789", at);
        if (first == std::string::npos) return;
        const std::size_t end = std::min(bytes.find_first_not_of("0123456789.", first), bytes.size());
        bytes = spliced(bytes, first, end - first, numbers[below(std::size(numbers))]);
    }

    std::string noise(std::size_t length) {
        std::string text;
        for (std::size_t i = 0; i < length; ++i) text += char(below(4) ? below(4) : below(256));
        return text;
    }

    std::mt19937 engine_;
    std::vector<std::string> words_;
};

}  // namespace bilayer::test
