// SPDX-License-Identifier: Apache-2.0
// The exact method, one brick at a time: pieces, clusters, blocks, signs.
#include "sdf/fill/exact.h"

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "sdf/base/box_relations.h"
#include "sdf/base/progress.h"
#include "sdf/fill/block_bins.h"
#include "sdf/fill/certificate.h"
#include "sdf/fill/clusters.h"
#include "sdf/fill/triangle_bins.h"
#include "sdf/sign/closest_side.h"
#include "sdf/sign/fallback_sign.h"

namespace bilayer::detail {
namespace {

/// Maximum edge length of a piece [voxels]. Longer edges are halved, so that a piece stays near the blocks that query
/// it and floats resolve its frame.
constexpr double maxPieceEdge = 16;
/// Maximum count of paths that are tried before the winding number of the whole mesh.
constexpr int maxPaths = 16;
/// Triangles whose boxes are farther than this from a path's are not crossed: above the rounding of floats [voxels].
constexpr float pathMargin = 1e-3f;

/// Whether the certificate is checked.
#ifdef BILAYER_VERIFY
constexpr bool verifying = true;
#else
constexpr bool verifying = false;
#endif

// Working memory of a thread, reused for each brick.
struct ExactBrickScratch {
    std::vector<Piece> pieces;
    Clusters clusters;
    BlockBins bins;
    std::vector<glm::ivec3> origins;
    std::vector<float> distances;
    std::vector<std::int32_t> triangles;
};

class ExactBrickFiller {
  public:
    ExactBrickFiller(const MeshJob& job, const TriangleBins& bins, double voxelsPerUnit, FallbackSign& fallbackSign,
                     ExactBrickScratch& scratch)
        : job_(job),
          bins_(bins),
          voxelsPerUnit_(voxelsPerUnit),
          fallbackSign_(fallbackSign),
          s_(scratch),
          side_(job.mesh, voxelsPerUnit) {}

    void fill(std::size_t brick) {
        origin_ = bins_.origins[brick];
        if (!wanted(origin_, bins_.side)) return;
        blocks_ = bins_.side / blockSide;
        cut(brick);
        s_.clusters.build(s_.pieces, origin_);
        s_.bins.build(s_.clusters.clusters(), blocks_, job_.reach);
        if constexpr (verifying) {
            requireCovered(s_.pieces, s_.clusters.clusters(), s_.clusters.members(), origin_);
            check_.emplace(job_.mesh, bins_.trianglesOf(brick), voxelsPerUnit_);
        }
        s_.origins.clear();
        s_.distances.clear();
        s_.triangles.clear();
        std::size_t number = 0;
        forEachBlockOfBrick([&](const glm::ivec3& inBrick) { fillBlock(number++, inBrick); });
        if (!s_.origins.empty()) job_.sink({s_.origins, s_.distances, s_.triangles});
    }

  private:
    bool wanted(const glm::ivec3& first, int side) const { return !job_.wanted || job_.wanted(first, side); }

    // Pieces outside this box reach none of the wanted blocks.
    TriangleLimits limitsOfWanted() const {
        glm::ivec3 lower = origin_, upper = origin_ + (bins_.side - blockSide);
        if (job_.wanted) {
            std::swap(lower, upper);
            forEachBlockOfBrick([&](const glm::ivec3& inBrick) {
                const glm::ivec3 block = origin_ + inBrick;
                if (!job_.wanted(block, blockSide)) return;
                lower = glm::min(lower, block);
                upper = glm::max(upper, block);
            });
        }
        const double margin = double(job_.reach) + 1.0;
        return {glm::dvec3(lower) - margin, glm::dvec3(upper + (blockSide - 1)) + margin};
    }

    template <class Visit>
    void forEachBlockOfBrick(Visit visit) const {
        for (int x = 0; x < blocks_; ++x)
            for (int y = 0; y < blocks_; ++y)
                for (int z = 0; z < blocks_; ++z) visit(blockSide * glm::ivec3(x, y, z));
    }

    void cut(std::size_t brick) {
        s_.pieces.clear();
        s_.pieces.reserve(bins_.trianglesOf(brick).size());
        const TriangleLimits limits = limitsOfWanted();
        PieceCutter cutter(maxPieceEdge, s_.pieces);
        detail::forEachTriangle(job_.mesh, bins_.trianglesOf(brick), voxelsPerUnit_,
                                [&](std::uint32_t triangle, const TriangleCorners& corners) {
                                    if (++cut_ % trianglesPerPoll == 0) job_.progress.poll();
                                    if (!job_.wanted || !misses(corners, limits)) cutter.cut(corners, triangle, limits);
                                });
        cutter.finish();
    }

    void fillBlock(std::size_t number, const glm::ivec3& inBrick) {
        reaching_ = s_.bins.at(number);
        block_ = origin_ + inBrick;
        if ((reaching_.empty() && !verifying) || !wanted(block_, blockSide)) return;
        job_.progress.poll();
        inBrick_ = inBrick;
        candidates_.clear();
        const bool any = measureBlock({reaching_, s_.clusters.clusters().data(), s_.clusters.members().data(),
                                       s_.pieces.data(), block_, glm::vec3(inBrick), job_.reach},
                                      found_);
        if constexpr (verifying) check_->require(block_, s_.pieces, found_, job_.reach);
        if (!any) return;
        const std::size_t first = s_.distances.size();
        s_.origins.push_back(block_);
        s_.distances.resize(first + blockVoxels);
        signDistances(found_, job_.sign ? insideVoxels() : BlockMask{}, s_.distances.data() + first);
        if (!job_.triangles) return;
        for (const std::int32_t nearest : found_.nearest)
            s_.triangles.push_back(nearest < 0 ? -1
                                               : std::int32_t(s_.pieces[std::size_t(nearest >> sideBits)].triangle));
    }

    // Voxels that project onto a face have a known sign, which links propagate. Each remaining component is queried at
    // one voxel, one far from the surface if possible.
    BlockMask insideVoxels() {
        BlockSides sides{found_.outside, found_.inside};
        const std::size_t onBoth =
            completeSides(findSignLinks(found_.distance), {&found_.far, &found_.mid, &found_.known}, sides,
                          [&](int voxel) { return isInside(voxel, sides.outside, sides.inside); });
        if (onBoth > 0 && job_.conflicts) *job_.conflicts += onBoth;
        return sides.inside;
    }

    // Classifies a voxel by its closest feature. If the normals cancel out there, follows a path to a voxel of known
    // sign. The last fallback is the winding number.
    bool isInside(int voxel, const BlockMask& outside, const BlockMask& inside) {
        const glm::ivec3 local = inBlock(voxel);
        const auto nearest = std::size_t(found_.nearest[voxel] >> sideBits);
        const glm::dvec3 point(block_ + local);
        side_.begin(point);
        side_.offer(s_.pieces[nearest].triangle);
        const float distance = float(side_.distance()) + sideSlack;
        forEachNear(
            [&](const glm::vec3& sample, float radius) {
                const glm::vec3 away = glm::vec3(local + inBrick_) - sample;
                return glm::dot(away, away) <= (distance + radius) * (distance + radius);
            },
            [&](std::uint32_t triangle) { side_.offer(triangle); });
        if (const Side side = side_.side(); side != Side::undecided) return side == Side::inside;
        if (const auto known = insideByPaths(local, outside, inside)) return *known;
        return fallbackSign_.isInside(point / voxelsPerUnit_);
    }

    static glm::ivec3 inBlock(int voxel) { return {voxel / 64, voxel / 8 % 8, voxel % 8}; }

    // Visits the triangles of all pieces within range, some more than once.
    template <class Near, class Visit>
    void forEachNear(Near near, Visit visit) const {
        for (const std::uint32_t c : reaching_) {
            const Cluster& cluster = s_.clusters.clusters()[c];
            if (!near(cluster.sample, cluster.radius)) continue;
            for (std::uint32_t m = cluster.begin; m < cluster.end; ++m) {
                const ClusterMember& member = s_.clusters.members()[m];
                if (near(member.sample, member.radius)) visit(s_.pieces[member.piece].triangle);
            }
        }
    }

    // Tries straight paths to voxels of known sign that are far from the surface, at most maxPaths.
    std::optional<bool> insideByPaths(const glm::ivec3& from, const BlockMask& outside, const BlockMask& inside) {
        if (candidates_.empty()) findCandidates();
        int tries = 0;
        for (std::size_t x = 0; x < inside.size(); ++x)
            for (std::uint64_t targets = found_.far[x] & (outside[x] | inside[x]); targets != 0;
                 targets &= targets - 1) {
                const int bit = std::countr_zero(targets);
                const bool knownInside = (inside[x] >> bit) & 1;
                const auto winding = windingAtStart(from, inBlock(int(x) * 64 + bit), knownInside ? 1 : 0);
                if (winding && (*winding == 0 || *winding == 1)) return *winding == 1;
                if (++tries == maxPaths) return std::nullopt;
            }
        return std::nullopt;
    }

    // The triangles that reach the block, each once: those that paths within it may cross.
    void findCandidates() {
        forEachNear([](const glm::vec3&, float) { return true; },
                    [&](std::uint32_t triangle) {
                        candidates_.push_back({triangle, {}});
                    });
        std::ranges::sort(candidates_, {}, &PathCandidate::triangle);
        const auto same = [](const PathCandidate& a, const PathCandidate& b) { return a.triangle == b.triangle; };
        candidates_.erase(std::unique(candidates_.begin(), candidates_.end(), same), candidates_.end());
        side_.begin(glm::dvec3(block_));
        for (PathCandidate& candidate : candidates_)
            for (const glm::dvec3& corner : side_.cornersOf(candidate.triangle)) candidate.box.add(glm::vec3(corner));
    }

    // Returns the winding number at the start of a straight path in the block, given the number at its end.
    std::optional<int> windingAtStart(const glm::ivec3& from, const glm::ivec3& to, int atEnd) {
        const Bounds path{glm::vec3(glm::min(from, to)) - pathMargin, glm::vec3(glm::max(from, to)) + pathMargin};
        side_.begin(glm::dvec3(block_ + from));
        int winding = atEnd;
        for (const PathCandidate& candidate : candidates_) {
            if (!overlap(candidate.box, path)) continue;
            const std::optional<int> crossing =
                segmentCrossing(side_.cornersOf(candidate.triangle), glm::dvec3(to - from));
            if (!crossing) return std::nullopt;
            winding += *crossing;
        }
        return winding;
    }

    /// A triangle that paths within the block may cross.
    struct PathCandidate {
        std::uint32_t triangle;
        Bounds box;  ///< relative to the block [voxels]
    };

    const MeshJob& job_;
    const TriangleBins& bins_;
    double voxelsPerUnit_;
    FallbackSign& fallbackSign_;
    ExactBrickScratch& s_;
    std::size_t cut_ = 0;
    std::optional<BlockCheck> check_;  ///< of the brick, while verifying
    ClosestSide side_;
    BlockDistances found_;
    std::vector<PathCandidate> candidates_;
    std::span<const std::uint32_t> reaching_;  // clusters of the current block
    glm::ivec3 origin_{0}, block_{0}, inBrick_{0};
    int blocks_ = 0;
};

}  // namespace

bool exactIsVerified() {
    return verifying;
}

void fillExact(const MeshJob& job, const Bounds& box) {
    const double voxelsPerUnit = 1.0 / double(job.voxelSize);
    const TriangleBins bins = binTriangles(job.mesh, box, voxelsPerUnit, job.reach, &job.progress);
    if constexpr (verifying) requireCompleteBins(job.mesh, bins, voxelsPerUnit, job.reach);
    job.progress.begin(bins.count());
    FallbackSign fallbackSign(job);
    tbb::enumerable_thread_specific<ExactBrickScratch> scratch;
    tbb::parallel_for(std::size_t(0), bins.count(), [&](std::size_t brick) {
        ExactBrickFiller(job, bins, voxelsPerUnit, fallbackSign, scratch.local()).fill(brick);
        job.progress.advance();
    });
}

}  // namespace bilayer::detail
