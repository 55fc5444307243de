#include "sdf/layer_samples.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

namespace bilayer {
namespace {

/// Most rows and columns of samples in one run: about what a voxel's neighbourhood holds.
constexpr int mostRows = 4;
/// Runs of triangles with a mean area below this are gathered: several of them share a voxel [voxels^2].
constexpr double smallArea = 0.5;
/// More cells than this, 1 MiB of counters, and runs stay alone.
constexpr double mostCells = 1 << 18;
constexpr float cellSize = 1;  // finer or coarser took longer (measured) [voxels]
/// Rounding of a group's own numbers [voxels].
constexpr float groupSlack = 1e-4f;

}  // namespace

void LayerSamples::begin(const glm::ivec3& origin, int side, float reach, float delta, bool cells) {
    origin_ = origin;
    lower_ = glm::vec3(-reach);
    upper_ = glm::vec3(float(side - 1) + reach);
    twiceDelta_ = 2 * delta;
    wantCells_ = cells;
    areas_ = 0;
    groups_.clear();
    runs_.clear();
    places_.clear();
    cells_.clear();
}

// Adds the samples of Algorithm 1 in runs of equal sides, without those that stay away from the brick.
void LayerSamples::addRows(const TilePart& part, std::uint32_t triangle) {
    const TriangleCorners& c = part.corners;
    const int n = part.rows;
    const int parts = (n + mostRows - 1) / mostRows, runSide = (n + parts - 1) / parts;
    const double step = 1.0 / double(n);
    const glm::dvec3 s1 = (c[1] - c[0]) * step, s2 = (c[2] - c[1]) * step, s3 = (c[2] - c[0]) * step;
    const glm::dvec3 start = c[0] + (s1 + s3) / 3.0;
    const glm::vec3 first(start - origin_), down(s1), across(s2);
    for (int row = 0; row < n; row += runSide) {
        const int end = std::min(row + runSide, n);
        // rows that stay away as a whole: a triangle may be much larger than a brick
        const glm::vec3 begins[2] = {first + float(row) * down, first + float(end - 1) * down};
        const glm::vec3 ends[2] = {begins[0] + float(row) * across, begins[1] + float(end - 1) * across};
        if (staysAway(glm::min(glm::min(begins[0], begins[1]), glm::min(ends[0], ends[1])),
                      glm::max(glm::max(begins[0], begins[1]), glm::max(ends[0], ends[1]))))
            continue;
        for (int column = 0; column < end; column += runSide) {
            const auto begin = std::uint32_t(places_.size());
            glm::vec3 lower(1e30f), upper(-1e30f);
            for (int i = row; i < end; ++i)
                for (int j = column; j < std::min(column + runSide, i + 1); ++j) {
                    const glm::vec3 place = first + float(i) * down + float(j) * across;
                    places_.push_back(place);
                    lower = glm::min(lower, place);
                    upper = glm::max(upper, place);
                }
            if (staysAway(lower, upper))
                places_.resize(begin);
            else
                addRun(part, triangle, begin);
        }
    }
    if (!wantCells_) return;
    const auto known = std::uint32_t(cells_.size());
    for (std::size_t i = known; i < places_.size(); ++i) cells_.push_back(nearestLattice(places_[i]));
}

void LayerSamples::finish() {
    if (areas_ < 2 * smallArea * double(runs_.size())) gatherRuns();
    if (!groups_.empty()) return;
    groups_.reserve(runs_.size());
    for (std::uint32_t run = 0; run < runs_.size(); ++run) groups_.push_back(groupOf(run));
}

LayerGroup LayerSamples::groupOf(std::uint32_t index) const {
    const LayerRun& run = runs_[index];
    const glm::vec3 normal = run.twiceOffset / twiceDelta_, offset = 0.5f * run.twiceOffset;
    if (run.end - run.begin == 1) return {places_[run.begin], groupSlack, normal, groupSlack, offset, index, index + 1};
    glm::vec3 lower(1e30f), upper(-1e30f);
    for (std::uint32_t i = run.begin; i < run.end; ++i) {
        lower = glm::min(lower, places_[i]);
        upper = glm::max(upper, places_[i]);
    }
    const glm::vec3 middle = 0.5f * (lower + upper);
    float radius2 = 0;
    for (std::uint32_t i = run.begin; i < run.end; ++i) {
        const glm::vec3 away = places_[i] - middle;
        radius2 = std::max(radius2, glm::dot(away, away));
    }
    const float height = std::abs(glm::dot(places_[run.begin] - middle, normal));
    return {middle, std::sqrt(radius2) + groupSlack, normal, height + groupSlack, offset, index, index + 1};
}

void LayerSamples::gatherRuns() {
    glm::vec3 lower(1e30f), upper(-1e30f);
    for (const LayerRun& run : runs_) {
        lower = glm::min(lower, places_[run.begin]);
        upper = glm::max(upper, places_[run.begin]);
    }
    const Cells cells(lower, upper, cellSize);
    if (cells.count() > mostCells) return;
    sort_.run(
        runs_, cells, [&](const LayerRun& run) { return places_[run.begin]; },
        [&](std::uint32_t begin, std::uint32_t end) { groups_.push_back(cluster(begin, end)); });
}

LayerGroup LayerSamples::cluster(std::uint32_t begin, std::uint32_t end) {
    glm::vec3 middle(0), offset(0);
    float count = 0;
    for (std::uint32_t r = begin; r < end; ++r) {
        const auto samples = float(runs_[r].end - runs_[r].begin);
        for (std::uint32_t s = runs_[r].begin; s < runs_[r].end; ++s) middle += places_[s];
        offset += 0.5f * samples * runs_[r].twiceOffset;
        count += samples;
    }
    middle /= count;
    offset /= count;
    const float length = glm::length(offset);
    const glm::vec3 normal = length > 0 ? offset / length : glm::vec3(0, 0, 1);
    float radius2 = 0, thickness = 0, nearest2 = 1e30f;
    std::uint32_t first = begin;
    for (std::uint32_t r = begin; r < end; ++r) {
        const glm::vec3 aside = 0.5f * runs_[r].twiceOffset - offset;
        for (std::uint32_t s = runs_[r].begin; s < runs_[r].end; ++s) {
            const glm::vec3 away = places_[s] - middle;
            const float away2 = glm::dot(away, away);
            // |away +- aside| <= its root, and so is |away|
            radius2 = std::max(radius2, away2 + 2 * std::abs(glm::dot(away, aside)) + glm::dot(aside, aside));
            thickness = std::max(thickness, std::abs(glm::dot(away, normal)));
            if (away2 < nearest2) {
                nearest2 = away2;
                first = r;
            }
        }
    }
    std::swap(runs_[begin], runs_[first]);
    return {middle, std::sqrt(radius2) + groupSlack, normal, thickness + groupSlack, offset, begin, end};
}

}  // namespace bilayer
