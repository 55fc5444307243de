#include "sdf/layer_samples.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <utility>

namespace bilayer {
namespace {

/// Rows and columns of samples in one run: as many as a voxel's neighbourhood holds.
constexpr int runSide = 3;
/// Runs with a mean size below this are gathered: several of them share a voxel [voxels].
constexpr double smallSize = 0.9;
/// More cells than this, 1 MiB of counters, and runs stay alone.
constexpr double mostCells = 1 << 18;
constexpr float cellSize = 1.f;  // finer or coarser took longer (measured) [voxels]
/// Rounding of a group's own numbers [voxels].
constexpr float groupSlack = 1e-4f;

}  // namespace

void LayerSamples::begin(const glm::ivec3& origin, int side, float reach, bool cells) {
    origin_ = origin;
    lower_ = glm::vec3(-reach);
    upper_ = glm::vec3(float(side - 1) + reach);
    wantCells_ = cells;
    sizes_ = 0;
    groups_.clear();
    runs_.clear();
    places_.clear();
    cells_.clear();
}

void LayerSamples::add(const Tile& tile, std::int32_t triangle) {
    for (int i = 0; i < tile.rows; i += runSide)
        for (int j = 0; j <= std::min(i + runSide, tile.rows) - 1; j += runSide) addPart(tile, triangle, i, j);
}

// Adds a run of at most runSide x runSide samples, if it comes near the brick.
void LayerSamples::addPart(const Tile& tile, std::int32_t triangle, int firstRow, int firstColumn) {
    const glm::vec3 shift(tile.base - origin_);
    const auto begin = std::uint32_t(places_.size());
    glm::vec3 lower(1e30f), upper(-1e30f);
    for (int i = firstRow; i < std::min(firstRow + runSide, tile.rows); ++i)
        for (int j = firstColumn; j < std::min(firstColumn + runSide, i + 1); ++j) {
            const glm::vec3 local = tile.first + float(i) * tile.down + float(j) * tile.across;
            const glm::vec3 place = shift + local;
            places_.push_back(place);
            if (wantCells_) cells_.push_back(shift + glm::floor(local + 0.5f));
            lower = glm::min(lower, place);
            upper = glm::max(upper, place);
        }
    if (glm::any(glm::lessThan(upper, lower_)) || glm::any(glm::greaterThan(lower, upper_))) {
        places_.resize(begin);
        if (wantCells_) cells_.resize(begin);
        return;
    }
    const auto end = std::uint32_t(places_.size()), run = std::uint32_t(runs_.size());
    const glm::vec3 middle = 0.5f * (lower + upper);
    float radius2 = 0;
    for (std::uint32_t i = begin; i < end; ++i) {
        const glm::vec3 away = places_[i] - middle;
        radius2 = std::max(radius2, glm::dot(away, away));
    }
    sizes_ += double(std::abs(tile.down.x) + std::abs(tile.down.y) + std::abs(tile.down.z)) * (end - begin);
    runs_.push_back({2.f * tile.offset, triangle, begin, end});
    const glm::vec3 normal = glm::normalize(tile.offset);
    const float height = std::abs(glm::dot(places_[begin] - middle, normal));
    groups_.push_back(
        {middle, std::sqrt(radius2) + groupSlack, normal, height + groupSlack, tile.offset, run, run + 1});
}

void LayerSamples::finish() {
    if (sizes_ < smallSize * double(runs_.size())) groupRuns();
}

void LayerSamples::groupRuns() {
    glm::vec3 lower(1e30f), upper(-1e30f);
    for (const LayerGroup& group : groups_) {
        lower = glm::min(lower, group.sample);
        upper = glm::max(upper, group.sample);
    }
    const glm::ivec3 size = glm::ivec3((upper - lower) / cellSize) + 1;
    if (double(size.x) * double(size.y) * double(size.z) > mostCells) return;
    sortByCell(lower, size);
    groups_.clear();
    for (std::uint32_t begin = 0, end; begin < runs_.size(); begin = end) {
        for (end = begin + 1; end < runs_.size() && cellOf_[end] == cellOf_[begin];) ++end;
        addCluster(begin, end);
    }
}

// A counting sort of the runs; `cellOf_` then holds their cells in the new order.
void LayerSamples::sortByCell(const glm::vec3& lower, const glm::ivec3& size) {
    cellOf_.resize(runs_.size());
    cursors_.assign(std::size_t(size.x) * std::size_t(size.y) * std::size_t(size.z), 0);
    for (std::size_t i = 0; i < runs_.size(); ++i) {
        const glm::ivec3 cell((groups_[i].sample - lower) / cellSize);
        cellOf_[i] = std::uint32_t((cell.x * size.y + cell.y) * size.z + cell.z);
        ++cursors_[cellOf_[i]];
    }
    std::uint32_t sum = 0;
    for (std::uint32_t& cursor : cursors_) sum += std::exchange(cursor, sum);
    unsorted_.swap(runs_);
    runs_.resize(unsorted_.size());
    for (std::size_t i = 0; i < unsorted_.size(); ++i) runs_[cursors_[cellOf_[i]]++] = unsorted_[i];
    // each cursor now stands at the end of its cell
    std::uint32_t at = 0;
    for (std::uint32_t cell = 0; cell < cursors_.size(); ++cell)
        for (; at < cursors_[cell]; ++at) cellOf_[at] = cell;
}

void LayerSamples::addCluster(std::uint32_t begin, std::uint32_t end) {
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
    groups_.push_back({middle, std::sqrt(radius2) + groupSlack, normal, thickness + groupSlack, offset, begin, end});
}

}  // namespace bilayer
