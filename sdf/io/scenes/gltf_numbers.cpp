// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/scenes/gltf_numbers.h"

#include <algorithm>
#include <cstdint>
#include <cstring>

namespace bilayer::detail {
namespace {

template <class T>
T read(const unsigned char* bytes) {
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return value;
}

// Returns a number, converted to its represented value if it is normalised: section 3.11 of the glTF 2.0 specification.
double number(const unsigned char* bytes, int componentType, bool normalized) {
    const auto scaled = [&](double value, double one) { return normalized ? std::max(value / one, -1.0) : value; };
    switch (componentType) {
        case TINYGLTF_COMPONENT_TYPE_BYTE:
            return scaled(read<std::int8_t>(bytes), 127);
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
            return scaled(read<std::uint8_t>(bytes), 255);
        case TINYGLTF_COMPONENT_TYPE_SHORT:
            return scaled(read<std::int16_t>(bytes), 32767);
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
            return scaled(read<std::uint16_t>(bytes), 65535);
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
            return scaled(read<std::uint32_t>(bytes), 4294967295.0);
        default:
            return double(read<float>(bytes));
    }
}

unsigned unsignedInteger(const unsigned char* bytes, int componentType) {
    switch (componentType) {
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
            return read<std::uint8_t>(bytes);
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
            return read<std::uint16_t>(bytes);
        default:
            return read<std::uint32_t>(bytes);
    }
}

bool isUnsignedType(int componentType) {
    return componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
           componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
           componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

bool isNumberType(int componentType) {
    return isUnsignedType(componentType) || componentType == TINYGLTF_COMPONENT_TYPE_BYTE ||
           componentType == TINYGLTF_COMPONENT_TYPE_SHORT || componentType == TINYGLTF_COMPONENT_TYPE_FLOAT;
}

std::size_t sizeOf(int componentType) {
    return std::size_t(tinygltf::GetComponentSizeInBytes(std::uint32_t(componentType)));
}

std::size_t componentsOf(int type) {
    return std::size_t(tinygltf::GetNumComponentsInType(std::uint32_t(type)));
}

const char* typeName(int type) {
    switch (type) {
        case TINYGLTF_TYPE_SCALAR:
            return "SCALAR";
        case TINYGLTF_TYPE_VEC2:
            return "VEC2";
        case TINYGLTF_TYPE_VEC3:
            return "VEC3";
        case TINYGLTF_TYPE_VEC4:
            return "VEC4";
        case TINYGLTF_TYPE_MAT4:
            return "MAT4";
        default:
            return "MAT2 or MAT3";
    }
}

}  // namespace

const tinygltf::Accessor& GltfNumbers::accessor(int index, int type, const std::string& use) const {
    const std::size_t count = model_.accessors.size();
    require(index >= 0 && std::size_t(index) < count, "{} is accessor {}, but the file has {} accessors", use, index,
            count);
    const tinygltf::Accessor& found = model_.accessors[std::size_t(index)];
    require(found.type == type, "accessor {}, used as {}, is of type {}; it must be {}", index, use,
            typeName(found.type), typeName(type));
    require(isNumberType(found.componentType),
            "accessor {}, used as {}, has componentType {}; it must be 5120 to 5123, 5125 or 5126", index, use,
            found.componentType);
    return found;
}

GltfNumbers::Elements GltfNumbers::elements(int view, std::size_t offset, std::size_t count, std::size_t size,
                                            const std::string& of) const {
    require(view >= 0 && std::size_t(view) < model_.bufferViews.size(),
            "{} is in buffer view {}, but the file has {} buffer views", of, view, model_.bufferViews.size());
    const tinygltf::BufferView& v = model_.bufferViews[std::size_t(view)];
    require(v.buffer >= 0 && std::size_t(v.buffer) < model_.buffers.size(),
            "buffer view {} is in buffer {}, but the file has {} buffers", view, v.buffer, model_.buffers.size());
    const std::vector<unsigned char>& data = model_.buffers[std::size_t(v.buffer)].data;
    require(v.byteOffset <= data.size() && v.byteLength <= data.size() - v.byteOffset,
            "buffer view {} ends at byte {} + {} of buffer {}, which has {} bytes", view, v.byteOffset, v.byteLength,
            v.buffer, data.size());
    const std::size_t stride = v.byteStride ? v.byteStride : size;
    require(stride >= size, "buffer view {} has byteStride {}; {} needs at least {}", view, stride, of, size);
    const bool inside = count == 0 || (offset <= v.byteLength && size <= v.byteLength - offset &&
                                       count - 1 <= (v.byteLength - offset - size) / stride);
    require(inside, "{} needs {} elements of {} bytes from byte {} on, but buffer view {} has {} bytes", of, count,
            size, offset, view, v.byteLength);
    return {count == 0 ? nullptr : data.data() + v.byteOffset + offset, stride};
}

std::vector<double> GltfNumbers::numbers(int index, int type, const std::string& use) const {
    const tinygltf::Accessor& a = accessor(index, type, use);
    const std::string of = fmt::format("accessor {} ({})", index, use);
    const std::size_t components = componentsOf(type), size = sizeOf(a.componentType);
    require(a.count <= std::vector<double>().max_size() / components, "{} has {} elements, too many to hold", of,
            a.count);
    // without a buffer view, all elements are zero before sparse ones replace them
    if (a.bufferView < 0) {
        require(a.sparse.isSparse, "{} has neither a buffer view nor sparse elements", of);
        std::vector<double> zeros(a.count * components);
        replaceSparse(zeros, a, of);
        return zeros;
    }
    const Elements from = elements(a.bufferView, a.byteOffset, a.count, components * size, of);
    std::vector<double> values;
    values.reserve(a.count * components);
    for (std::size_t i = 0; i < a.count; ++i)
        for (std::size_t k = 0; k < components; ++k)
            values.push_back(number(from.first + i * from.stride + k * size, a.componentType, a.normalized));
    if (a.sparse.isSparse) replaceSparse(values, a, of);
    return values;
}

void GltfNumbers::replaceSparse(std::vector<double>& values, const tinygltf::Accessor& a, const std::string& of) const {
    const auto& sparse = a.sparse;
    require(sparse.count >= 0 && sparse.indices.byteOffset >= 0 && sparse.values.byteOffset >= 0,
            "{}: a sparse count or byteOffset is negative", of);
    require(isUnsignedType(sparse.indices.componentType),
            "{}: its sparse indices have componentType {}; it must be 5121, 5123 or 5125", of,
            sparse.indices.componentType);
    const std::size_t components = componentsOf(a.type), size = sizeOf(a.componentType);
    const auto count = std::size_t(sparse.count);
    const Elements indices = elements(sparse.indices.bufferView, std::size_t(sparse.indices.byteOffset), count,
                                      sizeOf(sparse.indices.componentType), of + ", sparse indices");
    const Elements from = elements(sparse.values.bufferView, std::size_t(sparse.values.byteOffset), count,
                                   components * size, of + ", sparse values");
    for (std::size_t i = 0; i < count; ++i) {
        const std::size_t at = unsignedInteger(indices.first + i * indices.stride, sparse.indices.componentType);
        require(at < a.count, "{}: sparse element {} replaces element {} of {}", of, i, at, a.count);
        for (std::size_t k = 0; k < components; ++k)
            values[at * components + k] =
                number(from.first + i * from.stride + k * size, a.componentType, a.normalized);
    }
}

std::vector<unsigned> GltfNumbers::unsignedIntegers(int index, const std::string& use) const {
    const tinygltf::Accessor& a = accessor(index, TINYGLTF_TYPE_SCALAR, use);
    require(isUnsignedType(a.componentType),
            "accessor {}, used as {}, has componentType {}; it must be 5121, 5123 or 5125", index, use,
            a.componentType);
    require(!a.normalized, "accessor {}, used as {}, is normalized; integers are not", index, use);
    // a double holds every 32-bit integer exactly
    const std::vector<double> values = numbers(index, TINYGLTF_TYPE_SCALAR, use);
    return {values.begin(), values.end()};
}

std::vector<glm::dvec3> GltfNumbers::vectors3(int index, const std::string& use) const {
    const std::vector<double> v = numbers(index, TINYGLTF_TYPE_VEC3, use);
    std::vector<glm::dvec3> vectors;
    vectors.reserve(v.size() / 3);
    for (std::size_t i = 0; i < v.size(); i += 3) vectors.push_back({v[i], v[i + 1], v[i + 2]});
    return vectors;
}

std::vector<glm::dvec4> GltfNumbers::vectors4(int index, const std::string& use) const {
    const std::vector<double> v = numbers(index, TINYGLTF_TYPE_VEC4, use);
    std::vector<glm::dvec4> vectors;
    vectors.reserve(v.size() / 4);
    for (std::size_t i = 0; i < v.size(); i += 4) vectors.push_back({v[i], v[i + 1], v[i + 2], v[i + 3]});
    return vectors;
}

std::vector<glm::dmat4> GltfNumbers::matrices(int index, const std::string& use) const {
    const std::vector<double> v = numbers(index, TINYGLTF_TYPE_MAT4, use);
    std::vector<glm::dmat4> matrices(v.size() / 16);
    for (std::size_t i = 0; i < v.size(); ++i) matrices[i / 16][int(i % 16 / 4)][int(i % 4)] = v[i];
    return matrices;
}

}  // namespace bilayer::detail
