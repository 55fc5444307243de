// SPDX-License-Identifier: Apache-2.0
// Reports the progress of a build, and stops the build when the caller asks for that.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <functional>
#include <mutex>
#include <vector>

#include <bilayer/sdf/options.h>

namespace bilayer::detail {

/// Thread-safe. Only one thread at a time calls the callback.
class Progress {
  public:
    /// Short enough for a smooth progress bar and a prompt cancellation.
    static constexpr std::chrono::steady_clock::duration usualInterval = std::chrono::milliseconds(5);

    /// @param callback  a reference is kept; a null function costs nothing
    /// @param interval  min time between two calls of the callback
    explicit Progress(const std::function<bool(float)>& callback,
                      std::chrono::steady_clock::duration interval = usualInterval)
        : callback_(callback), interval_(interval) {}

    /// Sets the total that advance() counts towards.
    void begin(std::size_t total) {
        total_ = total;
        done_ = 0;
    }

    /// Counts one more unit of the total as done. Throws Cancelled.
    void advance() {
        ++done_;
        poll();
    }

    /// Calls the callback if the interval since its last call has passed. Throws Cancelled. Call this every few
    /// milliseconds.
    void poll() {
        if (!callback_) return;
        if (cancelled_.load(std::memory_order_relaxed)) throw Cancelled();
        const auto now = std::chrono::steady_clock::now().time_since_epoch();
        if (now < next_.load(std::memory_order_relaxed)) return;
        const std::unique_lock lock(mutex_, std::try_to_lock);
        if (!lock || now < next_.load(std::memory_order_relaxed)) return;
        // a second pass, over a repaired mesh, must not report less progress than the first
        reported_ = std::max(reported_, total_ == 0 ? 0.f : workShare * float(done_) / float(total_));
        report(reported_);
        next_ = std::chrono::steady_clock::now().time_since_epoch() + interval_;
    }

    /// Reports that everything is done.
    void finish() {
        if (callback_) report(1);
    }

  private:
    void report(float part) {
        if (callback_(part)) return;
        cancelled_ = true;
        throw Cancelled();
    }

    /// The share of the progress that counted work takes. Joining blocks takes the rest and cannot be counted.
    static constexpr float workShare = 0.95f;
    const std::function<bool(float)>& callback_;
    const std::chrono::steady_clock::duration interval_;
    std::atomic<std::size_t> total_{0}, done_{0};
    float reported_ = 0;
    std::atomic<bool> cancelled_{false};
    std::atomic<std::chrono::steady_clock::duration> next_{std::chrono::steady_clock::duration::min()};
    std::mutex mutex_;
};

/// Suits loops over triangles that are sorted into bricks or cut into pieces: about 0.1 ms. Huge triangles poll more
/// often.
inline constexpr std::size_t trianglesPerPoll = 1024;

/// Polls unless `progress` is null. Throws Cancelled.
inline void poll(Progress* progress) {
    if (progress) progress->poll();
}

/// The numbers below n, for a loop that polls as it runs: `for (const std::size_t i : Polled(n, progress))`. Throws
/// Cancelled.
class Polled {
  public:
    /// @param progress  null: nothing is polled
    Polled(std::size_t n, Progress* progress) : n_(n), progress_(progress) {}

    class Iterator {
      public:
        Iterator(std::size_t at, Progress* progress) : at_(at), progress_(progress) {}
        std::size_t operator*() const { return at_; }
        Iterator& operator++() {
            if (++at_ % stepsPerPoll == 0) poll(progress_);
            return *this;
        }
        bool operator!=(const Iterator& other) const { return at_ != other.at_; }

      private:
        std::size_t at_;
        Progress* progress_;
    };
    Iterator begin() const { return {0, progress_}; }
    Iterator end() const { return {n_, progress_}; }

  private:
    /// Suits steps of at most a few microseconds.
    static constexpr std::size_t stepsPerPoll = 1024;

    std::size_t n_;
    Progress* progress_;
};

/// Returns a vector of n items that grows in chunks and polls between them, because allocating a large vector at once
/// takes too long for a prompt cancellation. Throws Cancelled.
template <class Item>
std::vector<Item> vectorOf(std::size_t n, Progress* progress) {
    constexpr std::size_t itemsPerPoll = (std::size_t(1) << 22) / sizeof(Item);
    std::vector<Item> items;
    items.reserve(n);
    while (items.size() < n) {
        items.resize(std::min(n, items.size() + itemsPerPoll));
        poll(progress);
    }
    return items;
}

/// Returns a comparison that polls as it is called, so that a sort can be cancelled. A cancelled sort leaves the items
/// in an unspecified order. Throws Cancelled.
template <class Less>
auto polled(Less less, Progress* progress) {
    return [less, progress](const auto& a, const auto& b) {
        constexpr unsigned comparisonsPerPoll = 8192;
        thread_local unsigned comparisons = 0;
        if (++comparisons % comparisonsPerPoll == 0) poll(progress);
        return less(a, b);
    };
}

}  // namespace bilayer::detail
