// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/input_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cctype>
#include <cerrno>
#include <stdexcept>
#include <system_error>

namespace bilayer::detail {

void requireInputFile(const std::filesystem::path& path) {
    const auto require = [&](bool holds, const std::string& why) {
        if (!holds) throw std::runtime_error(fmt::format("{}: {}", path.string(), why));
    };
    std::error_code error;
    const std::filesystem::file_status status = std::filesystem::status(path, error);
    require(status.type() != std::filesystem::file_type::not_found, "no such file");
    require(status.type() != std::filesystem::file_type::none, error.message());
    require(std::filesystem::is_regular_file(status), "not a regular file");
    const bool isReadable = ::access(path.c_str(), R_OK) == 0;
    require(isReadable, std::generic_category().message(errno));
}

std::string lowerExtension(const std::filesystem::path& path) {
    std::string extension = path.extension().string();
    for (char& c : extension) c = char(std::tolower(static_cast<unsigned char>(c)));
    return extension;
}

}  // namespace bilayer::detail
