// SPDX-License-Identifier: Apache-2.0
// Times peers that answer the same queries in turns.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "bench/measure.h"
#include "bench/peers.h"
#include "bench/ratios.h"

namespace bilayer::bench {

/// Queries in one order, "random" or "coherent".
template <class Question>
struct Questions {
    std::string order;
    std::vector<Question> all;
};

/// Time of a peer for queries in one order on a count of threads.
struct Time {
    std::string peer, order;
    int threads;
    double nanoseconds;          ///< per query, all threads together; the median of all rounds
    std::vector<double> rounds;  ///< of each round [s per query]
};

/// Seconds that a peer takes for all queries, one batch per thread.
template <class Question, class Answer>
double secondsOf(const Peer<Question, Answer>& peer, std::span<const Question> questions, std::span<Answer> answers,
                 int threads) {
    const std::size_t share = (questions.size() + std::size_t(threads) - 1) / std::size_t(threads);
    const Stopwatch watch;
    onThreads(threads, [&](int thread) {
        const std::size_t begin = std::min(questions.size(), share * std::size_t(thread));
        const std::size_t count = std::min(questions.size() - begin, share);
        peer.answer(questions.subspan(begin, count), answers.subspan(begin, count));
    });
    return watch.seconds();
}

/// Runs the peers in turns, in each order and on each count of threads, so that a slow minute affects all of them
/// alike.
template <class Question, class Answer>
std::vector<Time> race(const std::vector<Peer<Question, Answer>>& peers, const std::vector<Questions<Question>>& orders,
                       const std::vector<int>& threads, int rounds) {
    std::vector<Time> times;
    for (const auto& peer : peers)
        for (const auto& order : orders)
            for (const int count : threads) times.push_back({peer.name, order.order, count, 0, {}});
    for (int round = 0; round < rounds; ++round)
        for (std::size_t order = 0; order < orders.size(); ++order)
            for (std::size_t t = 0; t < threads.size(); ++t)
                for (std::size_t peer = 0; peer < peers.size(); ++peer) {
                    const std::span<const Question> questions = orders[order].all;
                    std::vector<Answer> answers(questions.size());
                    times[(peer * orders.size() + order) * threads.size() + t].rounds.push_back(
                        secondsOf(peers[peer], questions, std::span(answers), threads[t]) / double(questions.size()));
                }
    for (Time& time : times) time.nanoseconds = 1e9 * median(time.rounds);
    return times;
}

/// A table in Markdown: a row per peer, a column per order and count of threads. For each of `ours`, further rows give
/// its speed-up over each other peer.
/// @param ours  prefix of the names of our own peers
inline std::string table(const std::vector<Time>& times, const std::string& ours) {
    std::vector<std::string> peers;
    for (const Time& time : times)
        if (std::find(peers.begin(), peers.end(), time.peer) == peers.end()) peers.push_back(time.peer);
    const auto of = [&](const std::string& peer) {
        std::vector<Time> result;
        for (const Time& time : times)
            if (time.peer == peer) result.push_back(time);
        return result;
    };
    std::string text = "| ns |", rule = "|---|";
    for (const Time& time : of(peers.front())) {
        text += fmt::format(" {}, {} thread{} |", time.order, time.threads, time.threads > 1 ? "s" : "");
        rule += "---|";
    }
    text += "\n" + rule + "\n";
    for (const std::string& peer : peers) {
        text += fmt::format("| {} |", peer);
        for (const Time& time : of(peer)) text += fmt::format(" {:.1f} |", time.nanoseconds);
        text += "\n";
    }
    for (const std::string& mine : peers)
        for (const std::string& other : peers) {
            if (!mine.starts_with(ours) || other.starts_with(ours)) continue;
            text += fmt::format("| {}: times as fast as {} |", mine, other);
            const auto one = of(mine), two = of(other);
            for (std::size_t i = 0; i < one.size(); ++i)
                text += fmt::format(" {:.1f} |", two[i].nanoseconds / one[i].nanoseconds);
            text += "\n";
        }
    return text;
}

/// Adds the ratios of each of `ours` to each other peer.
/// @param what  was asked, and on which field
/// @param ours  prefix of the names of our own peers
inline void addRatios(const std::vector<Time>& times, const std::string& what, const std::string& ours,
                      Ratios& ratios) {
    for (const Time& mine : times)
        for (const Time& other : times)
            if (mine.peer.starts_with(ours) && !other.peer.starts_with(ours) && mine.order == other.order &&
                mine.threads == other.threads)
                ratios.add(
                    fmt::format("{}: {}, {}, {} threads / {}", what, mine.peer, mine.order, mine.threads, other.peer),
                    other.rounds, mine.rounds);
}

inline nlohmann::json toJson(const std::vector<Time>& times) {
    nlohmann::json result = nlohmann::json::array();
    for (const Time& time : times)
        result.push_back(
            {{"peer", time.peer}, {"order", time.order}, {"threads", time.threads}, {"nanoseconds", time.nanoseconds}});
    return result;
}

}  // namespace bilayer::bench
