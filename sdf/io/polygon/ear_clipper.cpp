// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/polygon/ear_clipper.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace bilayer::detail {

bool EarClipper::clip(std::span<const glm::dvec2> outline, Triangles& triangles) {
    start(outline);
    if (!wasConvex()) separate(triangles);
    tryAll();
    for (auto rule = EarRule::strict; outline_.left() > 0;) {
        fits_ &= rule < EarRule::convex;
        const bool all = tried_.size() == outline_.left();
        if (playRound(rule, triangles))
            rule = EarRule::strict;
        else if (all)
            rule = EarRule(int(rule) + 1);
        if (next_.empty())
            tryAll();
        else
            tryChanged();
    }
    return fits_;
}

void EarClipper::start(std::span<const glm::dvec2> outline) {
    outline_.reset(outline);
    rounds_.assign(outline.size(), 0);
    round_ = 0;
    fits_ = true;
    next_.clear();
    changed_.clear();
}

void EarClipper::tryAll() {
    tried_.clear();
    for (unsigned i = 0; i < outline_.size(); ++i)
        if (outline_[i].present) tried_.push_back(i);
}

void EarClipper::tryChanged() {
    std::swap(tried_, next_);
    next_.clear();
}

// Tries corners of which no neighbour was cut in the same round, so that long fans of triangles at one corner are rare.
// Returns whether any was cut.
bool EarClipper::playRound(EarRule rule, Triangles& triangles) {
    ++round_;
    bool any = false;
    for (const unsigned v : tried_) {
        if (!outline_[v].present || rounds_[v] == round_ || !outline_.mayCut(v, rule)) continue;
        cut(v, triangles);
        cutEmpty(triangles);
        any = true;
    }
    return any;
}

void EarClipper::cut(unsigned v, Triangles& triangles) {
    const unsigned a = outline_[v].before, b = outline_[v].after;
    triangles.push_back({a, v, b});
    outline_.cut(v);
    if (finish(a, triangles)) return;
    for (const unsigned corner : {a, b}) {
        update(corner);
        changed_.push_back(corner);
    }
}

// Removes the outline of a corner if it has at most three corners, and adds its last triangle.
bool EarClipper::finish(unsigned v, Triangles& triangles) {
    const unsigned second = outline_[v].after, third = outline_[second].after;
    if (outline_[third].after != v && third != v) return false;
    if (third != v) {
        const unsigned first = std::min({v, second, third});
        triangles.push_back({outline_[first].before, first, outline_[first].after});
        fits_ &= outline_.side(outline_[first].before, first, outline_[first].after) >= 0;
        outline_.remove(third);
    }
    outline_.remove(v);
    outline_.remove(second);
    return true;
}

// Cuts repeated corners and outward spikes, as far as cuts have made some. Where they remain, parts of the outline lie
// next to each other with nothing in between, and ears there cannot be distinguished from their surroundings.
void EarClipper::cutEmpty(Triangles& triangles) {
    while (!changed_.empty()) {
        const unsigned v = changed_.back(), next = outline_[v].after;
        if (outline_[v].present && outline_[v].at == outline_[next].at) {
            cut(next, triangles);
            continue;
        }
        changed_.pop_back();
        if (outline_[v].present && outline_.isEmpty(v)) cut(v, triangles);
    }
}

// Separates an outline where its inside is pinched to a point or to a line.
void EarClipper::separate(Triangles& triangles) {
    for (auto v = outline_.size(); v-- > 0;) changed_.push_back(v);
    cutEmpty(triangles);
    tryAll();
    const auto position = [&](unsigned v) { return std::tuple(outline_[v].at.x, outline_[v].at.y, v); };
    std::sort(tried_.begin(), tried_.end(), [&](unsigned v, unsigned w) { return position(v) < position(w); });
    const auto differ = [&](unsigned v, unsigned w) { return outline_[v].at != outline_[w].at; };
    for (auto begin = tried_.begin(); begin != tried_.end();) {
        const auto end = std::find_if(begin, tried_.end(), [&](unsigned v) { return differ(*begin, v); });
        for (auto v = begin; v != end; ++v)
            for (auto w = begin; w != end;) {
                const bool pinched = outline_.isPinched(*v, *w);
                if (pinched) split(*v, *w, triangles);
                w = pinched ? begin : w + 1;
            }
        begin = end;
    }
    cutEmpty(triangles);
}

void EarClipper::split(unsigned v, unsigned w, Triangles& triangles) {
    triangles.push_back({outline_[v].before, v, w});
    triangles.push_back({outline_[w].before, w, v});
    outline_.split(v, w);
    for (const unsigned corner : {v, w}) {
        if (finish(corner, triangles)) continue;
        outline_.classify(corner);
        changed_.push_back(corner);
    }
}

void EarClipper::update(unsigned v) {
    outline_.classify(v);
    if (rounds_[v] == round_) return;
    rounds_[v] = round_;
    next_.push_back(v);
}

}  // namespace bilayer::detail
