// SPDX-License-Identifier: Apache-2.0
// Arrays on huge pages, for large data with random access.
// Tested by tests/sdf/mesh.cpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <type_traits>
#include <vector>
#ifdef __linux__
#include <sys/mman.h>
#endif

namespace bilayer::detail {

inline constexpr std::size_t hugePage = 2 << 20;  ///< bytes

/// Requests huge pages for the part of a memory range that covers whole ones. If the system refuses, only speed
/// suffers.
inline void adviseHugePages([[maybe_unused]] void* data, [[maybe_unused]] std::size_t bytes) {
#ifdef MADV_HUGEPAGE
    const auto at = reinterpret_cast<std::uintptr_t>(data);
    const std::uintptr_t begin = (at + hugePage - 1) / hugePage * hugePage, end = (at + bytes) / hugePage * hugePage;
    if (begin < end) (void)::madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE);
#endif
}

/// Resizes an empty vector. The memory of a large one is placed on huge pages.
template <class T>
void resizeLarge(std::vector<T>& items, std::size_t size) {
    items.reserve(size);
    adviseHugePages(items.data(), size * sizeof(T));
    items.resize(size);
}

/// An array that starts uninitialised. A large array is placed on huge pages where the system supports them: random
/// reads then cause fewer TLB misses, and first writes cause fewer page faults. It is movable but not copyable;
/// shared() returns a second handle to the same memory.
template <class T>
class LargeArray {
    static_assert(std::is_trivially_copyable_v<T>);

  public:
    LargeArray() = default;

    /// Throws std::bad_alloc.
    explicit LargeArray(std::size_t size) : size_(size) {
        constexpr std::size_t line = 64;
        const std::size_t alignment = bytes() >= hugePage ? hugePage : line;
        const std::size_t whole = (bytes() + alignment - 1) / alignment * alignment;
        data_.reset(static_cast<T*>(std::aligned_alloc(alignment, whole)), [](T* data) { std::free(data); });
        if (whole && !data_) throw std::bad_alloc();
        adviseHugePages(data_.get(), whole);
    }

    LargeArray(LargeArray&&) noexcept = default;
    LargeArray& operator=(LargeArray&&) noexcept = default;

    /// Returns a handle to the same memory. The memory lives as long as any handle to it.
    LargeArray shared() const {
        LargeArray other;
        other.data_ = data_;
        other.size_ = size_;
        return other;
    }

    T& operator[](std::size_t i) { return data_[i]; }
    const T& operator[](std::size_t i) const { return data_[i]; }
    T* data() { return data_.get(); }
    const T* data() const { return data_.get(); }
    std::size_t size() const { return size_; }
    std::size_t bytes() const { return size_ * sizeof(T); }

  private:
    std::shared_ptr<T[]> data_;
    std::size_t size_ = 0;
};

}  // namespace bilayer::detail
