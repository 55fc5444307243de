// Memory for what is large and read at random.
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

/// Asks for huge pages where whole ones lie in a part of memory. A refusal costs speed only.
inline void adviseHugePages([[maybe_unused]] void* data, [[maybe_unused]] std::size_t bytes) {
#ifdef MADV_HUGEPAGE
    const auto at = reinterpret_cast<std::uintptr_t>(data);
    const std::uintptr_t begin = (at + hugePage - 1) / hugePage * hugePage, end = (at + bytes) / hugePage * hugePage;
    if (begin < end) (void)::madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE);
#endif
}

/// Resizes an empty vector; a large one comes to lie on huge pages.
template <class T>
void resizeLarge(std::vector<T>& items, std::size_t size) {
    items.reserve(size);
    adviseHugePages(items.data(), size * sizeof(T));
    items.resize(size);
}

/// An array that begins uninitialised, on huge pages where it is large and the system has them: random reads then miss
/// the translation buffer less, and the first writes fault less often. It moves; copies are asked for by name.
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

    /// The same memory, which lives as long as any of those that share it.
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
