// Memory for what is large and read at random.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <new>
#include <type_traits>
#ifdef __linux__
#include <sys/mman.h>
#endif

namespace bilayer::detail {

/// An array that begins uninitialised, on huge pages where it is large and the system has them: random reads then miss
/// the translation buffer less, and the first writes fault less often. It moves; copies are asked for by name.
template <class T>
class LargeArray {
    static_assert(std::is_trivially_copyable_v<T>);

  public:
    LargeArray() = default;

    /// Throws std::bad_alloc.
    explicit LargeArray(std::size_t size) : size_(size) {
        constexpr std::size_t hugePage = 2 << 20, line = 64;
        const std::size_t alignment = bytes() >= hugePage ? hugePage : line;
        const std::size_t whole = (bytes() + alignment - 1) / alignment * alignment;
        data_.reset(static_cast<T*>(std::aligned_alloc(alignment, whole)), [](T* data) { std::free(data); });
        if (whole && !data_) throw std::bad_alloc();
#ifdef MADV_HUGEPAGE
        // a refusal costs speed only
        if (alignment == hugePage) (void)::madvise(data_.get(), whole, MADV_HUGEPAGE);
#endif
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

    T& operator[](std::size_t i) {
        return data_[i];
    }
    const T& operator[](std::size_t i) const {
        return data_[i];
    }
    T* data() {
        return data_.get();
    }
    const T* data() const {
        return data_.get();
    }
    std::size_t size() const {
        return size_;
    }
    std::size_t bytes() const {
        return size_ * sizeof(T);
    }

  private:
    std::shared_ptr<T[]> data_;
    std::size_t size_ = 0;
};

}  // namespace bilayer::detail
