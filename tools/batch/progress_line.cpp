// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/progress_line.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <string>

namespace bilayer::tools {
namespace {

constexpr std::chrono::milliseconds interval{100};  // smooth, and no load on a slow terminal
constexpr const char* clearProgress = "\r\033[K";

std::string duration(double seconds) {
    const long long s = static_cast<long long>(seconds + 0.5);
    return s < 3600 ? fmt::format("{}:{:02}", s / 60, s % 60)
                    : fmt::format("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60);
}

}  // namespace

ProgressLine::ProgressLine() : visible_(::isatty(STDERR_FILENO)) {}

ProgressLine::~ProgressLine() {
    if (visible_) fmt::print(stderr, "{}", clearProgress);
}

void ProgressLine::show(const BatchCounts& counts) {
    const Clock::time_point now = Clock::now();
    if (!visible_ || now - drawn_ < interval) return;
    drawn_ = now;
    const double rate = double(counts.finished()) / std::chrono::duration<double>(now - start_).count();
    const std::string left = rate > 0 ? duration(double(counts.total - counts.finished()) / rate) : "?";
    fmt::print(stderr, "{}{} of {} meshes, {} failed, {:.3g}/s, {} left", clearProgress, counts.finished(),
               counts.total, counts.failed, rate, left);
    std::fflush(stderr);
}

}  // namespace bilayer::tools
