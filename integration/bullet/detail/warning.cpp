// SPDX-License-Identifier: Apache-2.0
#include "integration/bullet/detail/warning.h"

#include <bilayer/integration/bullet/dispatcher.h>
#include <fmt/core.h>

#include <cstdio>
#include <mutex>
#include <set>
#include <utility>

namespace bilayer::bullet {

namespace {

void print(const char* message) {
    fmt::print(stderr, "bilayer: {}\n", message);
}

std::mutex warningMutex;  // guards what follows
WarningCallback current = print;
std::set<const char*>& given() {
    static std::set<const char*>& all = *new std::set<const char*>;  // never destroyed: shapes may outlive it
    return all;
}

}  // namespace

WarningCallback setWarningCallback(WarningCallback callback) {
    const std::lock_guard lock(warningMutex);
    given().clear();
    return std::exchange(current, callback ? callback : print);
}

void detail::warn(const char* message) {
    WarningCallback callback;
    {
        const std::lock_guard lock(warningMutex);
        callback = current;
    }
    callback(message);
}

void detail::warnOnce(const char* message) {
    {
        const std::lock_guard lock(warningMutex);
        if (!given().insert(message).second) return;
    }
    warn(message);
}

}  // namespace bilayer::bullet
