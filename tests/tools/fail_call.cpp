// SPDX-License-Identifier: Apache-2.0
// A library to preload: lets one call of a program fail that writes a regular file. BILAYER_FAIL is "NAME NUMBER
// ERROR": the name of the function (write or rename), which of its calls fails, counted from 1, and the value of errno.
// A write that fails has written half of its bytes before, as on a disk that becomes full.
#include <dlfcn.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

struct Failure {
    char name[16] = "";
    int number = 0, error = 0;
    std::atomic<int> calls{0};

    Failure() {
        if (const char* const text = std::getenv("BILAYER_FAIL"))
            std::sscanf(text, "%15s %d %d", name, &number, &error);
    }
    bool isDue(const char* called) { return std::strcmp(called, name) == 0 && ++calls == number; }
};

Failure& failure() {
    static Failure only;
    return only;
}

template <class Function>
Function* next(const char* name) {
    return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

bool isRegular(int file) {
    struct stat status {};
    return ::fstat(file, &status) == 0 && S_ISREG(status.st_mode) && file > STDERR_FILENO;
}

}  // namespace

extern "C" ssize_t write(int file, const void* bytes, std::size_t count) {
    static auto* const real = next<ssize_t(int, const void*, std::size_t)>("write");
    if (!isRegular(file) || !failure().isDue("write")) return real(file, bytes, count);
    (void)!real(file, bytes, count / 2);
    errno = failure().error;
    return -1;
}

extern "C" ssize_t writev(int file, const struct iovec* parts, int count) {
    static auto* const real = next<ssize_t(int, const struct iovec*, int)>("writev");
    if (!isRegular(file) || !failure().isDue("write")) return real(file, parts, count);
    errno = failure().error;
    return -1;
}

extern "C" int rename(const char* from, const char* to) noexcept {
    static auto* const real = next<int(const char*, const char*)>("rename");
    if (!failure().isDue("rename")) return real(from, to);
    errno = failure().error;
    return -1;
}
