// SPDX-License-Identifier: Apache-2.0
// Which parts contain a part P follows in most cases from those that contain a part D around it. Let D contain P, and
// let D separate its inside from its outside. Take a third part X that separates as well and does not touch D. As a
// whole, X lies either inside of D or outside.
// - If X is larger than D, it contains P exactly if it contains D.
// - If X is smaller, it has to be tested.
// So the parts to test are those smaller than D, those that touch D, and those that do not separate.
//
// The parts that touch D are found in the same way. Let D lie in a part Q that it does not touch. A part that touches D
// and is larger than Q must touch Q. So the parts that touch D are between D and Q in size, or touch Q.
#include "sdf/mesh/part_nesting.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <numeric>

#include "sdf/base/progress.h"

namespace bilayer::detail {
namespace {

/// Max count of tests of one part against others. Beyond it, lines across the whole mesh cost less.
constexpr std::size_t maxTests = 16;

std::vector<unsigned> bySize(const MeshParts& parts) {
    std::vector<unsigned> order(parts.count());
    std::iota(order.begin(), order.end(), 0u);
    const auto size = [&](unsigned part) { return parts.empty(part) ? -1 : glm::length(parts.box(part).size()); };
    std::stable_sort(order.begin(), order.end(), [&](unsigned a, unsigned b) { return size(a) > size(b); });
    return order;
}

}  // namespace

PartNesting::PartNesting(const Mesh& mesh, const TriangleTree& tree, std::span<const unsigned> partOf,
                         std::size_t parts, Progress* progress)
    : parts_(mesh, partOf, parts, progress),
      order_(bySize(parts_)),
      rank_(parts),
      separating_(boxesOf(parts_, order_, true)),
      others_(boxesOf(parts_, order_, false)),
      containers_(parts),
      heritage_(parts) {
    for (unsigned i = 0; i < parts; ++i) rank_[order_[i]] = i;
    std::vector<std::uint8_t> found(parts);
    const auto forAll = [&](const auto& work) {
        tbb::parallel_for(std::size_t(0), parts, [&](std::size_t part) {
            poll(progress);
            if (!parts_.empty(unsigned(part))) work(unsigned(part));
        });
    };
    forAll([&](unsigned part) { found[part] = findInnermost(part, containers_[part]); });
    std::vector<bool> isInnermost(parts);
    for (const Containers& c : containers_)
        if (c.innermost != noPart) isInnermost[c.innermost] = true;
    for (const unsigned part : order_) {
        poll(progress);
        if (isInnermost[part]) heritage_[part].isInherited = findTouching(part, heritage_[part].touching);
    }
    forAll([&](unsigned part) {
        Containers& c = containers_[part];
        if (!found[part] || (c.innermost != noPart && !heritage_[c.innermost].isInherited))
            findAll(part, tree, c);
        else if (c.innermost != noPart)
            correct(part, c);
    });
}

PartBoxes PartNesting::boxesOf(const MeshParts& parts, std::span<const unsigned> order, bool separating) {
    std::vector<RankedBox> boxes;
    for (unsigned rank = 0; rank < order.size(); ++rank)
        if (const unsigned part = order[rank]; !parts.empty(part) && parts.separates(part) == separating)
            boxes.push_back({parts.box(part), part, rank});
    return PartBoxes(std::move(boxes));
}

// Returns false if that takes too many tests.
bool PartNesting::findInnermost(unsigned part, Containers& containers) const {
    std::size_t tests = 0;
    const auto test = [&](const RankedBox& item, bool& within) {
        if (item.part == part) return true;
        if (++tests > maxTests) return false;
        within = parts_.contains(item.part, part);
        return true;
    };
    others_.forEachAround(parts_.box(part), [&](const RankedBox& item) {
        bool within = false;
        const bool continues = test(item, within);
        if (within) containers.own.push_back(item.part);
        return continues;
    });
    if (tests > maxTests) return false;
    separating_.forEachAround(parts_.box(part), [&](const RankedBox& item) {
        bool within = false;
        const bool continues = test(item, within);
        if (!within) return continues;
        if (item.rank > rank_[part]) {
            containers.own.push_back(item.part);
            return true;
        }
        containers.innermost = item.part;
        return false;
    });
    return tests <= maxTests;
}

void PartNesting::findAll(unsigned part, const TriangleTree& tree, Containers& containers) const {
    containers = {};
    for (const unsigned outer : parts_.containersOf(part, tree))
        (parts_.separates(outer) && rank_[outer] < rank_[part] ? containers.added : containers.own).push_back(outer);
}

// Returns the innermost container that a part does not touch; `noPart` if none is known. Adds those that it touches.
unsigned PartNesting::clearContainer(unsigned part, std::vector<unsigned>& touching) const {
    unsigned outer = containers_[part].innermost;
    for (; outer != noPart && touching.size() <= maxTests; outer = containers_[outer].innermost) {
        if (parts_.intersect(part, outer))
            touching.push_back(outer);
        else if (heritage_[outer].isInherited)
            break;
    }
    return outer;
}

// Finds the larger parts that touch a part. Returns false if that takes too many tests.
bool PartNesting::findTouching(unsigned part, std::vector<unsigned>& touching) const {
    const unsigned clear = clearContainer(part, touching);
    std::size_t tests = touching.size();
    const std::vector<unsigned> climbed = touching;
    const auto test = [&](unsigned other) {
        if (std::find(climbed.begin(), climbed.end(), other) != climbed.end()) return true;
        if (++tests > maxTests) return false;
        if (parts_.intersect(part, other)) touching.push_back(other);
        return true;
    };
    if (tests > maxTests) return false;
    const unsigned first = clear == noPart ? 0 : rank_[clear] + 1, end = rank_[part];
    if (first < end)
        separating_.forEachOverlap(parts_.box(part), first, end - 1,
                                   [&](const RankedBox& item) { return test(item.part); });
    if (clear != noPart)
        for (const unsigned other : heritage_[clear].touching)
            if (!test(other)) break;
    return tests <= maxTests;
}

// Tests the parts that touch the innermost container.
void PartNesting::correct(unsigned part, Containers& containers) const {
    const unsigned innermost = containers.innermost;
    for (const unsigned outer : heritage_[innermost].touching) {
        const bool around = parts_.contains(outer, part), inherited = parts_.contains(outer, innermost);
        if (around && !inherited) containers.added.push_back(outer);
        if (!around && inherited) containers.removed.push_back(outer);
    }
}

}  // namespace bilayer::detail
