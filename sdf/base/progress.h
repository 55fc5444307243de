// Tells how far a build is, and stops it when the listener wants no more.
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

/// Safe from any thread; the listener is called by one at a time.
class Progress {
  public:
    /// Often enough for a bar that moves and a user who stops it.
    static constexpr std::chrono::steady_clock::duration usualInterval = std::chrono::milliseconds(5);

    /// @param listener  kept; a null one costs nothing
    /// @param interval  least time from one question to the next
    explicit Progress(const std::function<bool(float)>& listener,
                      std::chrono::steady_clock::duration interval = usualInterval)
        : listener_(listener), interval_(interval) {}

    /// DisjointSets what advance() counts against.
    void begin(std::size_t total) {
        total_ = total;
        done_ = 0;
    }

    /// One more of the total is done. Throws Cancelled.
    void advance() {
        ++done_;
        poll();
    }

    /// Asks the listener, if it has not been asked for a while. Throws Cancelled. Call it every few milliseconds.
    void poll() {
        if (!listener_) return;
        if (cancelled_.load(std::memory_order_relaxed)) throw Cancelled();
        const auto now = std::chrono::steady_clock::now().time_since_epoch();
        if (now < next_.load(std::memory_order_relaxed)) return;
        const std::unique_lock lock(mutex_, std::try_to_lock);
        if (!lock || now < next_.load(std::memory_order_relaxed)) return;
        // a second go, over a repaired mesh, must not fall behind the first
        told_ = std::max(told_, total_ == 0 ? 0.f : workShare * float(done_) / float(total_));
        tell(told_);
        next_ = std::chrono::steady_clock::now().time_since_epoch() + interval_;
    }

    /// All is done.
    void finish() {
        if (listener_) tell(1);
    }

  private:
    void tell(float part) {
        if (listener_(part)) return;
        cancelled_ = true;
        throw Cancelled();
    }

    /// The rest is for joining blocks, which cannot be counted.
    static constexpr float workShare = 0.95f;
    const std::function<bool(float)>& listener_;
    const std::chrono::steady_clock::duration interval_;
    std::atomic<std::size_t> total_{0}, done_{0};
    float told_ = 0;
    std::atomic<bool> cancelled_{false};
    std::atomic<std::chrono::steady_clock::duration> next_{std::chrono::steady_clock::duration::min()};
    std::mutex mutex_;
};

/// Asks, if there is somebody to ask. Throws Cancelled.
inline void poll(Progress* progress) {
    if (progress) progress->poll();
}

/// The numbers below n, for a loop that asks on its way: `for (const std::size_t i : Polled(n, progress))`. Throws
/// Cancelled.
class Polled {
  public:
    /// @param progress  null: nobody is asked
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
    /// For steps of some microseconds at most.
    static constexpr std::size_t stepsPerPoll = 1024;

    std::size_t n_;
    Progress* progress_;
};

/// A vector of n items that is made bit by bit: the memory of a large one takes longer to come than a user waits.
/// Throws Cancelled.
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

/// A comparison that asks on its way, so that what sorts by it can be cancelled; items are then in between. Throws
/// Cancelled.
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
