// SPDX-License-Identifier: Apache-2.0
// Checks that glTF files are refused.
#pragma once

#include <catch2/catch.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "sdf/io/scenes/scene_io.h"
#include "tests/support/gltf.h"

namespace bilayer::test {

using Strings = std::vector<std::string>;

/// Checks that reading the file fails with one line that names it and contains all words.
inline void refuses(Gltf gltf, const Strings& words) {
    const auto path = gltf.write("refused.gltf");
    INFO(gltf.file.dump().substr(0, 3000));
    try {
        detail::readScene(path);
        FAIL_CHECK("was read");
    } catch (const std::runtime_error& error) {
        const std::string text = error.what();
        CHECK_THAT(text, Catch::Contains(path.string() + ": "));
        CHECK(text.find('\n') == std::string::npos);
        for (const std::string& word : words) CHECK_THAT(text, Catch::Contains(word));
    }
}

}  // namespace bilayer::test
