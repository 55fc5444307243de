// SPDX-License-Identifier: Apache-2.0
// Writes to a temporary file, and keeps a list of the files in use that a signal handler may traverse at any time.
#include "sdf/io/atomic_file.h"

#include <fcntl.h>
#include <limits.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <exception>
#include <fstream>
#include <new>
#include <stdexcept>
#include <string>
#include <system_error>

namespace bilayer::detail {
namespace {

constexpr int endingSignals[] = {SIGINT, SIGTERM, SIGHUP};
constexpr mode_t newFileMode = 0666;  // as for std::ofstream; the umask removes bits

[[noreturn]] void fail(const std::filesystem::path& target, const std::string& why) {
    throw std::runtime_error("cannot write " + target.string() + ": " + why);
}

std::string lastError() {
    return std::generic_category().message(errno);
}

// Returns the file that the target's name refers to after following links.
std::filesystem::path resolve(const std::filesystem::path& target) {
    std::error_code error;
    const std::filesystem::file_status status = std::filesystem::status(target, error);
    if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
        fail(target, "not a regular file");
    if (!target.has_filename()) fail(target, "no file name");
    if (!std::filesystem::exists(status)) return target;
    if (::access(target.c_str(), W_OK) != 0) fail(target, lastError());
    const std::filesystem::path resolved = std::filesystem::canonical(target, error);
    return error ? target : resolved;
}

std::filesystem::path nameNextTo(const std::filesystem::path& target) {
    static std::atomic<unsigned> count{0};
    const std::string suffix = "." + std::to_string(::getpid()) + "-" + std::to_string(count++) + ".part";
    // part of a long name: the suffix must fit
    const std::string name = "." + target.filename().string();
    return target.parent_path() / (name.substr(0, NAME_MAX - suffix.size()) + suffix);
}

}  // namespace

// A file name that the signal handler may have to remove. Entries are reused and never freed, so the handler can
// traverse their list while other threads write files.
struct AtomicFile::Entry {
    enum State { idle, written, placed };  // placed: replacing its target, or done

    std::atomic<bool> taken{true};
    std::atomic<State> state{idle};
    char path[PATH_MAX];
    Entry* next = nullptr;

    static inline std::atomic<Entry*> first{nullptr};
    static inline std::atomic<bool> isLastPlaced{false};  // of the files that this process has started

    static Entry* take() {
        for (Entry* entry = first; entry; entry = entry->next)
            if (!entry->taken.exchange(true)) return entry;
        Entry* entry = new Entry;
        entry->next = first;
        while (!first.compare_exchange_weak(entry->next, entry)) {
        }
        return entry;
    }

    void watch(const std::string& name) {
        std::memcpy(path, name.c_str(), name.size() + 1);
        isLastPlaced = false;
        state = written;
    }

    void release() {
        state = idle;
        taken = false;
    }
};

AtomicFile::AtomicFile(const std::filesystem::path& target) : target_(target) {
    target_ = resolve(target);
    temporary_ = nameNextTo(target_);
    const std::string name = std::filesystem::absolute(temporary_).string();
    if (name.size() >= PATH_MAX) fail(target, std::generic_category().message(ENAMETOOLONG));

    // registered before the file is created, so that a signal never leaves an unregistered file
    entry_ = Entry::take();
    entry_->watch(name);
    const int file = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, newFileMode);
    if (file < 0) {
        const std::string why = lastError();
        entry_->release();
        fail(target, why);
    }
    struct stat old;
    if (::stat(target_.c_str(), &old) == 0) (void)!::fchmod(file, old.st_mode & 07777);
    ::close(file);
}

AtomicFile::~AtomicFile() {
    if (!entry_) return;
    ::unlink(temporary_.c_str());
    entry_->release();
}

void AtomicFile::commit() {
    // set before the rename, so that no signal ends the process as if the file were not in place
    entry_->state = Entry::placed;
    Entry::isLastPlaced = true;
    if (::rename(temporary_.c_str(), target_.c_str()) != 0) {
        const std::string why = lastError();
        Entry::isLastPlaced = false;
        entry_->state = Entry::written;
        fail(target_, why);
    }
    entry_->release();
    entry_ = nullptr;
}

void writeWhole(const std::filesystem::path& target, const std::function<void(std::ostream&)>& write) {
    AtomicFile file(target);
    try {
        std::ofstream stream(file.temporary(), std::ios::binary);
        stream.exceptions(std::ios::failbit | std::ios::badbit);
        write(stream);
        stream.close();
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception&) {
        throw std::runtime_error(target.string() + ": cannot be written (is the disk full?)");
    }
    file.commit();
}

// Runs as a signal handler, so it may only use atomics, unlink(), signal() and raise().
void AtomicFile::removeAll(int signal) {
    static std::atomic<bool> cameLate{false};
    bool isLate = Entry::isLastPlaced;
    for (const Entry* entry = Entry::first; entry; entry = entry->next)
        if (entry->state == Entry::written) isLate = false;
    if (isLate && !cameLate.exchange(true)) return;
    for (const Entry* entry = Entry::first; entry; entry = entry->next)
        if (entry->state != Entry::idle) ::unlink(entry->path);
    std::signal(signal, SIG_DFL);
    ::raise(signal);
}

void removeAtomicFilesOnSignal() {
    struct sigaction action = {};
    action.sa_handler = AtomicFile::removeAll;
    action.sa_flags = SA_NODEFER | SA_RESTART;
    for (const int signal : endingSignals) {
        struct sigaction old;
        const bool ignored = ::sigaction(signal, nullptr, &old) == 0 && old.sa_handler == SIG_IGN;
        if (!ignored) ::sigaction(signal, &action, nullptr);
    }
}

}  // namespace bilayer::detail
