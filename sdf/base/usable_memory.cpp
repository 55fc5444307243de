// SPDX-License-Identifier: Apache-2.0
#include "sdf/base/usable_memory.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>

namespace bilayer::detail {
namespace {

constexpr double unlimited = std::numeric_limits<double>::infinity();

double physicalMemory() {
    return double(::sysconf(_SC_PHYS_PAGES)) * double(::sysconf(_SC_PAGESIZE));
}

double limitOf(decltype(RLIMIT_AS) resource) {
    rlimit limit{};
    if (::getrlimit(resource, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return unlimited;
    return double(limit.rlim_cur);
}

/// The number in a file; infinite if there is no such file, or "max" in it.
double numberIn(const std::filesystem::path& path) {
    std::ifstream file(path);
    double number = 0;
    return file >> number ? number : unlimited;
}

/// The smallest limit of a control group and of those that it is part of.
double limitOfGroups(const std::filesystem::path& root, std::filesystem::path group, const char* file) {
    double limit = numberIn(root / file);
    for (group = group.relative_path(); !group.empty(); group = group.parent_path())
        limit = std::min(limit, numberIn(root / group / file));
    return limit;
}

/// Lines of /proc/self/cgroup are "0::/group" in version 2, and "12:memory:/group" in version 1.
double controlGroupLimit() {
    double limit = unlimited;
    std::ifstream groups("/proc/self/cgroup");
    for (std::string line; std::getline(groups, line);) {
        const std::size_t first = line.find(':'), second = line.find(':', first + 1);
        if (second == std::string::npos) continue;
        const std::string kind = line.substr(first + 1, second - first - 1), group = line.substr(second + 1);
        if (kind.empty()) limit = std::min(limit, limitOfGroups("/sys/fs/cgroup", group, "memory.max"));
        if (kind == "memory")
            limit = std::min(limit, limitOfGroups("/sys/fs/cgroup/memory", group, "memory.limit_in_bytes"));
    }
    return limit;
}

}  // namespace

double usableMemory() {
    static const double ofMachine = std::min(physicalMemory(), controlGroupLimit());
    return std::min(ofMachine, limitOf(RLIMIT_AS));
}

double remainingMemory() {
    std::ifstream file("/proc/self/statm");
    double addressSpace = 0, resident, shared, text, libraries, data = 0;  // [pages]
    file >> addressSpace >> resident >> shared >> text >> libraries >> data;
    const auto page = double(::sysconf(_SC_PAGESIZE));
    return std::max(std::min(limitOf(RLIMIT_AS) - page * addressSpace, limitOf(RLIMIT_DATA) - page * data), 0.0);
}

}  // namespace bilayer::detail
