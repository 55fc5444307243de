// SPDX-License-Identifier: Apache-2.0
// Reads numbers from the buffers of a glTF file. Each range is checked before it is read; internal.
// Tested by tests/sdf/gltf_numbers.cpp through readGltf().
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "sdf/io/scenes/tinygltf.h"

namespace bilayer::detail {

/// Throws std::runtime_error with a formatted text unless `holds` is true.
template <class... Values>
void require(bool holds, fmt::format_string<Values...> text, Values&&... values) {
    if (!holds) throw std::runtime_error(fmt::format(text, std::forward<Values>(values)...));
}

/// Reads accessors. Every member function throws std::runtime_error that names the faulty accessor or buffer view and
/// states what would be correct. Normalised integers are converted to the values that they represent.
class GltfNumbers {
  public:
    explicit GltfNumbers(const tinygltf::Model& model) : model_(model) {}

    /// `use` names the purpose of the numbers, such as "POSITION" or "indices".
    std::vector<unsigned> unsignedIntegers(int accessor, const std::string& use) const;
    std::vector<glm::dvec3> vectors3(int accessor, const std::string& use) const;
    std::vector<glm::dvec4> vectors4(int accessor, const std::string& use) const;
    std::vector<glm::dmat4> matrices(int accessor, const std::string& use) const;

  private:
    /// Elements of equal size at a constant stride in a buffer.
    struct Elements {
        const unsigned char* first;
        std::size_t stride;
    };
    const tinygltf::Accessor& accessor(int index, int type, const std::string& use) const;
    Elements elements(int view, std::size_t offset, std::size_t count, std::size_t size, const std::string& of) const;
    std::vector<double> numbers(int accessor, int type, const std::string& use) const;
    void replaceSparse(std::vector<double>& numbers, const tinygltf::Accessor& accessor, const std::string& of) const;

    const tinygltf::Model& model_;
};

}  // namespace bilayer::detail
