// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/batch_folder.h"

#include <fmt/format.h>

#include <stdexcept>
#include <system_error>

#include "sdf/io/content_hash.h"
#include "tools/output.h"

namespace bilayer::tools {

void BatchFolder::create() const {
    for (const char* name : {"records", "work", "thumbnails"}) {
        std::error_code error;
        std::filesystem::create_directories(own() / name, error);
        if (error)
            throw std::runtime_error(fmt::format("cannot create {}: {}", (own() / name).string(), error.message()));
    }
}

std::filesystem::path BatchFolder::thumbnail(const std::string& name) const {
    return own() / "thumbnails" / (hex(detail::contentHash(name)) + ".png");
}

}  // namespace bilayer::tools
