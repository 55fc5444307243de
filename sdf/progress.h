// Tells how far a build is, and stops it when the listener wants no more.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>

#include "sdf/build.h"

namespace bilayer {

/// Safe from any thread; the listener is called by one at a time.
class Progress {
  public:
    /// A null listener costs nothing.
    explicit Progress(const std::function<bool(float)>& listener) : listener_(listener) {}

    /// Sets what advance() counts against. The listener hears parts from `from` to `to`.
    void begin(std::size_t total, float from, float to) {
        total_ = total;
        from_ = from;
        to_ = to;
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
        const float part = total_ == 0 ? 1.f : float(done_) / float(total_);
        if (!listener_(from_ + (to_ - from_) * part)) {
            cancelled_ = true;
            throw Cancelled();
        }
        next_ = std::chrono::steady_clock::now().time_since_epoch() + interval;
    }

  private:
    /// Often enough for a bar that moves and a user who stops it.
    static constexpr std::chrono::steady_clock::duration interval = std::chrono::milliseconds(5);

    const std::function<bool(float)>& listener_;
    std::atomic<std::size_t> total_{0}, done_{0};
    std::atomic<float> from_{0}, to_{1};
    std::atomic<bool> cancelled_{false};
    std::atomic<std::chrono::steady_clock::duration> next_{std::chrono::steady_clock::duration::min()};
    std::mutex mutex_;
};

}  // namespace bilayer
