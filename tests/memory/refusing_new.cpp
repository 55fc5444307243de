// SPDX-License-Identifier: Apache-2.0
#include "tests/memory/refusing_new.h"

#include <dlfcn.h>
#include <execinfo.h>

#include <atomic>
#include <cstdlib>
#include <new>
#include <string_view>

namespace {

std::atomic<bool> isCounting{false};
std::atomic<std::size_t> count{0}, refused{0};

/// Whether OpenVDB is destroying a tree: it allocates memory for that, and no exception may leave a destructor.
bool isDestroyingTree() {
    constexpr int maxFrames = 64;
    void* frames[maxFrames];
    const int found = ::backtrace(frames, maxFrames);
    for (int i = 0; i < found; ++i) {
        Dl_info function{};
        if (::dladdr(frames[i], &function) == 0 || !function.dli_sname) continue;
        const std::string_view name = function.dli_sname;
        if (name.find("openvdb") != name.npos && name.find("4Tree") != name.npos && name.ends_with("5clearEv"))
            return true;
    }
    return false;
}

void* allocated(std::size_t size, std::size_t alignment) {
    if (isCounting && ++count == refused && !isDestroyingTree()) throw std::bad_alloc();
    if (size == 0) size = 1;
    void* const memory = alignment <= __STDCPP_DEFAULT_NEW_ALIGNMENT__
                             ? std::malloc(size)
                             : std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
    if (!memory) throw std::bad_alloc();
    return memory;
}

void* orNull(std::size_t size, std::size_t alignment) noexcept {
    try {
        return allocated(size, alignment);
    } catch (const std::bad_alloc&) {
        return nullptr;
    }
}

}  // namespace

namespace bilayer::test {

void refuseAllocation(std::size_t number) {
    void* frame = nullptr;
    ::backtrace(&frame, 1);  // allocates at its first call
    count = 0;
    refused = number;
    isCounting = true;
}

std::size_t endRefusal() {
    isCounting = false;
    return count;
}

}  // namespace bilayer::test

void* operator new(std::size_t size) {
    return allocated(size, 0);
}
void* operator new[](std::size_t size) {
    return allocated(size, 0);
}
void* operator new(std::size_t size, std::align_val_t alignment) {
    return allocated(size, std::size_t(alignment));
}
void* operator new[](std::size_t size, std::align_val_t alignment) {
    return allocated(size, std::size_t(alignment));
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
    return orNull(size, 0);
}
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept {
    return orNull(size, 0);
}
void* operator new(std::size_t size, std::align_val_t alignment, const std::nothrow_t&) noexcept {
    return orNull(size, std::size_t(alignment));
}
void* operator new[](std::size_t size, std::align_val_t alignment, const std::nothrow_t&) noexcept {
    return orNull(size, std::size_t(alignment));
}
void operator delete(void* memory) noexcept {
    std::free(memory);
}
void operator delete[](void* memory) noexcept {
    std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
    std::free(memory);
}
void operator delete[](void* memory, std::size_t) noexcept {
    std::free(memory);
}
void operator delete(void* memory, std::align_val_t) noexcept {
    std::free(memory);
}
void operator delete[](void* memory, std::align_val_t) noexcept {
    std::free(memory);
}
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
    std::free(memory);
}
void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept {
    std::free(memory);
}
