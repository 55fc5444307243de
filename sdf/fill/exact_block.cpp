// Highway compiles the code between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE once per instruction set.
#include "sdf/fill/exact_block.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sdf/fill/exact_block.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

HWY_BEFORE_NAMESPACE();
namespace bilayer::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace {

/// As many voxels at once as there are lanes: half a row along z, a row, or two rows.
using Tag = hn::CappedTag<float, 2 * blockSide>;
using IntTag = hn::RebindToSigned<Tag>;
using Vec = hn::Vec<Tag>;
using Mask = hn::Mask<Tag>;

/// Upper bound of the float error of a distance, with a margin [voxels]. Pieces that are too far by this much are still
/// evaluated, so that the nearest piece never depends on the order.
constexpr float boundSlack = 1e-4f;
/// Sample bounds are increased by this fraction and this amount, together at least 2e-5 voxels. A piece's own distance
/// then replaces its sample's, although the two are rounded differently.
constexpr float raisedPart = 1e-3f, raisedBy = 5e-7f;  // [voxels^2]
/// Rounding of squared heights, with a margin [voxels^2].
constexpr float heightSlack = 1e-3f;
/// A slice is the 64 voxels with one x. A chunk is one SIMD vector of a slice.
constexpr int sliceVoxels = blockSide * blockSide;
constexpr int chunkVoxels = int(hn::MaxLanes(Tag()));

// Lattice coordinates of the voxels in a slice.
struct BlockLattice {
    HWY_ALIGN float y[sliceVoxels], z[sliceVoxels];
};
constexpr BlockLattice lattice = [] {
    BlockLattice l{};
    for (int i = 0; i < sliceVoxels; ++i) {
        l.y[i] = float(i / blockSide);
        l.z[i] = float(i % blockSide);
    }
    return l;
}();

inline float square(float value) {
    return value * value;
}

inline Vec squareOf(Vec v) {
    return hn::Mul(v, v);
}

inline int firstFrom(float coordinate) {
    return coordinate > 0 ? int(coordinate) : 0;
}

inline int lastTo(float coordinate) {
    return coordinate < 0 ? -1 : std::min(blockSide - 1, int(coordinate));
}

// Calls visit(c, first slice, last slice) for the chunks that a ball may reach. Tests only the ball's box: a cheap test
// saves more than excluding the corners.
template <class Visit>
inline void forEachChunk(const glm::vec3& centre, float radius, Visit visit) {
    const int x0 = firstFrom(centre.x - radius), x1 = lastTo(centre.x + radius);
    if (x0 > x1) return;
    const int end = (lastTo(centre.y + radius) + 1) * blockSide;
    for (int c = firstFrom(centre.y - radius) * blockSide / chunkVoxels; c * chunkVoxels < end; ++c) visit(c, x0, x1);
}

// One value per slice.
struct Slices {
    using Row = hn::CappedTag<float, blockSide>;
    using RowVec = hn::Vec<Row>;

    // Evaluates make(x) for all slices at once, with x relative to `centre`.
    template <class Make>
    Slices(float centre, Make make) {
        const Row row;
        for (std::size_t x = 0; x < std::size_t(blockSide); x += hn::Lanes(row))
            hn::Store(make(hn::Sub(hn::Iota(row, float(x)), hn::Set(row, centre))), row, of + x);
    }
    static RowVec square(RowVec v) { return hn::Mul(v, v); }

    HWY_ALIGN float of[blockSide];
};

inline Vec latticeY(int c) {
    return hn::Load(Tag(), lattice.y + c * chunkVoxels);
}

inline Vec latticeZ(int c) {
    return hn::Load(Tag(), lattice.z + c * chunkVoxels);
}

// Reduces squared distances to those to a sample.
inline void applySample(const glm::vec3& sample, float reach, BlockDistances& block) {
    const Tag tag;
    const Slices px2(sample.x, Slices::square);
    forEachChunk(sample, reach, [&](int c, int x0, int x1) {
        const Vec across2 = hn::Add(squareOf(hn::Sub(latticeY(c), hn::Set(tag, sample.y))),
                                    squareOf(hn::Sub(latticeZ(c), hn::Set(tag, sample.z))));
        float* nearest2 = block.nearest2 + x0 * sliceVoxels + c * chunkVoxels;
        for (int x = x0; x <= x1; ++x, nearest2 += sliceVoxels)
            hn::Store(hn::Min(hn::Load(tag, nearest2), hn::Add(hn::Set(tag, px2.of[x]), across2)), tag, nearest2);
    });
}

// A bounding disc, or a bounding cylinder ("drum") with some thickness, around pieces, relative to a block. Consider a
// voxel at height h over the drum's plane and at distance r from its axis, with an upper bound b of its distance. It is
// farther than b from the drum if r > radius + sqrt(b^2 - g^2), where g = max(0, |h| - thickness). Squaring this twice
// removes the roots. r^2 = d^2 - h^2 follows from the distance d to the centre.
class Drum {
  public:
    Drum(const glm::vec3& centre, float radius, const glm::vec3& normal, float thickness)
        : centre_(centre),
          normal_(normal),
          thickness_(thickness + boundSlack),
          radius2_(square(radius + boundSlack)),
          px2_(centre.x, Slices::square),
          height_(centre.x, [&](auto px) { return hn::Mul(px, hn::Set(Slices::Row(), normal.x)); }) {}

    // Returns the slices out of x0 .. x1, one bit each, in which chunk c has a voxel that the drum may be nearest to.
    template <bool thick>
    inline unsigned near(int c, int x0, int x1, const BlockDistances& block) const {
        const Column column(*this, c);
        const float* bound2 = block.nearest2 + x0 * sliceVoxels + c * chunkVoxels;
        unsigned near = 0;
        for (int x = x0; x <= x1; ++x, bound2 += sliceVoxels)
            near |= unsigned(mayBeNearest<thick>(column, x, bound2)) << x;
        return near;
    }

    // The same for the slices `among`.
    inline unsigned near(int c, unsigned among, const BlockDistances& block) const {
        const Column column(*this, c);
        unsigned near = 0;
        for (; among != 0; among &= among - 1) {
            const int x = std::countr_zero(among);
            const bool may = mayBeNearest<false>(column, x, block.nearest2 + x * sliceVoxels + c * chunkVoxels);
            near |= unsigned(may) << x;
        }
        return near;
    }

  private:
    // Values shared by all slices of a chunk.
    struct Column {
        Column(const Drum& drum, int c) {
            const Tag tag;
            const Vec py = hn::Sub(latticeY(c), hn::Set(tag, drum.centre_.y)),
                      pz = hn::Sub(latticeZ(c), hn::Set(tag, drum.centre_.z));
            excess = hn::Sub(hn::Add(squareOf(py), squareOf(pz)), hn::Set(tag, drum.radius2_));
            height = hn::Add(hn::Mul(py, hn::Set(tag, drum.normal_.y)), hn::Mul(pz, hn::Set(tag, drum.normal_.z)));
            fourRadius2 = hn::Set(tag, 4 * drum.radius2_);
        }
        Vec excess, height, fourRadius2;
    };

    template <bool thick>
    inline bool mayBeNearest(const Column& column, int x, const float* bounds2) const {
        const Tag tag;
        const Vec bound2 = hn::Load(tag, bounds2);
        const Vec h = hn::Add(hn::Set(tag, height_.of[x]), column.height);
        Vec excess = hn::Sub(hn::Add(hn::Set(tag, px2_.of[x]), column.excess), bound2), g2 = squareOf(h);
        if constexpr (thick) {
            const Vec h2 = g2;
            g2 = squareOf(hn::Max(hn::Sub(hn::Abs(h), hn::Set(tag, thickness_)), hn::Zero(tag)));
            excess = hn::Add(excess, hn::Sub(g2, h2));
        }
        const Vec limit = hn::Mul(column.fourRadius2, hn::Add(hn::Sub(bound2, g2), hn::Set(tag, heightSlack)));
        return !hn::AllFalse(tag, hn::Le(hn::Mul(excess, hn::Abs(excess)), limit));
    }

    glm::vec3 centre_, normal_;
    float thickness_, radius2_;
    Slices px2_, height_;
};

// A piece relative to a block.
class SeenPiece {
  public:
    SeenPiece(const Piece& piece, std::uint32_t number, const glm::ivec3& block)
        : piece_(piece),
          code_(std::int32_t(number << sideBits)),
          shift_(block - piece.base),
          u_(along(piece.u.x)),
          w_(along(piece.w.x)),
          n_(along(piece.n.x)) {}

    // Reduces the distances in some slices of chunk c to those to the piece. Lattice coordinates are exact in floats,
    // so a voxel gets the same bytes in any block.
    inline void apply(int c, unsigned slices, BlockDistances& block) const {
        const Tag tag;
        const auto place = [&](Vec lattice, int shift, float origin) {
            return hn::Sub(hn::Add(lattice, hn::Set(tag, float(shift))), hn::Set(tag, origin));
        };
        const Vec py = place(latticeY(c), shift_.y, piece_.origin.y),
                  pz = place(latticeZ(c), shift_.z, piece_.origin.z);
        const auto across = [&](const glm::vec3& axis) {
            return hn::Add(hn::Mul(py, hn::Set(tag, axis.y)), hn::Mul(pz, hn::Set(tag, axis.z)));
        };
        const Vec u = across(piece_.u), w = across(piece_.w), n = across(piece_.n);
        for (; slices != 0; slices &= slices - 1) {
            const int x = std::countr_zero(slices);
            const auto at = [&](const Slices& along, Vec across) { return hn::Add(hn::Set(tag, along.of[x]), across); };
            lower(at(u_, u), at(w_, w), at(n_, n), x * sliceVoxels + c * chunkVoxels, block);
        }
    }

  private:
    // The x-dependent part of a coordinate along an axis.
    Slices along(float axis) const {
        const Slices::Row row;
        // The shift is added first: it and x are integers, so their sum is exact.
        Slices part(-float(shift_.x),
                    [&](auto x) { return hn::Mul(hn::Sub(x, hn::Set(row, piece_.origin.x)), hn::Set(row, axis)); });
        return part;
    }

    // Returns how far a coordinate along an edge lies outside the edge.
    static Vec beyond(Vec along, float length) {
        const Tag tag;
        return hn::Sub(along, hn::Min(hn::Max(along, hn::Zero(tag)), hn::Set(tag, length)));
    }

    inline void lower(Vec u, Vec w, Vec n, int voxel, BlockDistances& block) const {
        const Tag tag;
        const Piece& t = piece_;
        const Vec base2 = hn::Add(squareOf(beyond(u, t.length)), squareOf(w));
        // The edges from both ends of the longest edge to the third corner.
        const Vec ox = hn::Set(tag, t.ox), oy = hn::Set(tag, t.oy), ex = hn::Set(tag, t.ex), ey = hn::Set(tag, t.ey);
        const Vec v = hn::Sub(u, hn::Set(tag, t.length));
        const Vec leftOf = hn::Sub(hn::Mul(w, ox), hn::Mul(u, oy)), rightOf = hn::Sub(hn::Mul(w, ex), hn::Mul(v, ey));
        const Vec left2 = hn::Add(squareOf(beyond(hn::Add(hn::Mul(u, ox), hn::Mul(w, oy)), t.olen)), squareOf(leftOf));
        const Vec right2 =
            hn::Add(squareOf(beyond(hn::Add(hn::Mul(v, ex), hn::Mul(w, ey)), t.elen)), squareOf(rightOf));
        const Vec zero = hn::Zero(tag), n2 = squareOf(n);
        const Mask above = hn::And(hn::And(hn::Gt(w, zero), hn::Le(leftOf, zero)), hn::Ge(rightOf, zero));
        const Vec distance2 = hn::Add(n2, hn::IfThenZeroElse(above, hn::Min(base2, hn::Min(left2, right2))));
        store(distance2, n, hn::And(above, hn::Gt(n2, hn::Set(tag, square(minFaceHeight)))), voxel, block);
    }

    // Keeps the smaller distance and its piece. Where the voxel projects onto a face, its normal gives the sign, unless
    // two pieces at equal distance (within float accuracy) disagree.
    inline void store(Vec distance2, Vec height, Mask overFace, int voxel, BlockDistances& block) const {
        const Tag tag;
        const IntTag intTag;
        const Vec old2 = hn::Load(tag, block.nearest2 + voxel), nearest2 = hn::Min(distance2, old2);
        const auto old = hn::Load(intTag, block.nearest + voxel), sides = hn::Set(intTag, (1 << sideBits) - 1);
        const auto side = hn::IfThenElse(hn::RebindMask(intTag, hn::Gt(height, hn::Zero(tag))),
                                         hn::Set(intTag, code_ + sideOutside), hn::Set(intTag, code_ + sideInside));
        const auto code = hn::IfThenElse(hn::RebindMask(intTag, overFace), side, hn::Set(intTag, code_));
        const auto winner = hn::IfThenElse(hn::RebindMask(intTag, hn::Lt(distance2, old2)), code, old);
        const Vec difference = hn::Sub(hn::Max(distance2, old2), nearest2);
        const Mask tied =
            hn::Le(difference, hn::Add(hn::Mul(nearest2, hn::Set(tag, distanceTie)), hn::Set(tag, distanceTie)));
        const auto agreed = hn::Or(hn::AndNot(sides, winner), hn::And(hn::And(code, old), sides));
        hn::Store(nearest2, tag, block.nearest2 + voxel);
        hn::Store(hn::IfThenElse(hn::RebindMask(intTag, tied), agreed, winner), intTag, block.nearest + voxel);
    }

    const Piece& piece_;
    std::int32_t code_;
    glm::ivec3 shift_;
    Slices u_, w_, n_;
};

// Initial bounds: the distances to the samples. They are slightly increased, so that a piece's own distance replaces
// its sample's.
void applySamples(const BlockInput& input, BlockDistances& block) {
    const Tag tag;
    const IntTag intTag;
    const Vec reach2 = hn::Set(tag, square(input.reach));
    for (int i = 0; i < blockVoxels; i += chunkVoxels) hn::Store(reach2, tag, block.nearest2 + i);
    for (const std::uint32_t index : input.reaching)
        applySample(input.clusters[index].sample - input.inBrick, input.reach, block);
    for (int i = 0; i < blockVoxels; i += chunkVoxels) {
        const Vec raised =
            hn::Add(hn::Mul(hn::Load(tag, block.nearest2 + i), hn::Set(tag, 1 + raisedPart)), hn::Set(tag, raisedBy));
        hn::Store(hn::Min(raised, reach2), tag, block.nearest2 + i);
        hn::Store(hn::Set(intTag, -1), intTag, block.nearest + i);
    }
}

// The slices near a cluster for each chunk, one bit each.
struct NearChunks {
    int first, last;
    unsigned slices[sliceVoxels / chunkVoxels];
};

// Evaluates the members of a cluster that come near its chunks.
inline void askMembers(const BlockInput& input, const Cluster& cluster, const NearChunks& near, BlockDistances& block) {
    if (cluster.end - cluster.begin == 1) {
        const std::uint32_t number = input.members[cluster.begin].piece;
        const SeenPiece piece(input.pieces[number], number, input.origin);
        for (int c = near.first; c <= near.last; ++c) piece.apply(c, near.slices[c], block);
        return;
    }
    for (std::uint32_t m = cluster.begin; m < cluster.end; ++m) {
        const ClusterMember& member = input.members[m];
        const Drum drum(member.sample - input.inBrick, member.radius, member.normal, 0);
        NearChunks ask{near.first, near.last, {}};
        unsigned any = 0;
        for (int c = near.first; c <= near.last; ++c) any |= ask.slices[c] = drum.near(c, near.slices[c], block);
        if (any == 0) continue;
        const SeenPiece piece(input.pieces[member.piece], member.piece, input.origin);
        for (int c = near.first; c <= near.last; ++c)
            if (ask.slices[c] != 0) piece.apply(c, ask.slices[c], block);
    }
}

void askPieces(const BlockInput& input, BlockDistances& block) {
    for (const std::uint32_t index : input.reaching) {
        const Cluster& cluster = input.clusters[index];
        const glm::vec3 sample = cluster.sample - input.inBrick;
        const Drum drum(sample, cluster.radius, cluster.normal, cluster.thickness);
        NearChunks near{sliceVoxels, -1, {}};
        forEachChunk(sample, input.reach + cluster.radius, [&](int c, int x0, int x1) {
            near.slices[c] =
                cluster.thickness > 0 ? drum.near<true>(c, x0, x1, block) : drum.near<false>(c, x0, x1, block);
            if (near.slices[c] == 0) return;
            near.first = std::min(near.first, c);
            near.last = c;
        });
        if (near.first <= near.last) askMembers(input, cluster, near, block);
    }
}

inline void setBits(Mask mask, int voxel, BlockMask& bits) {
    std::uint8_t some[8] = {};
    hn::StoreMaskBits(Tag(), mask, some);
    std::uint64_t word;
    std::memcpy(&word, some, sizeof word);
    bits[std::size_t(voxel / sliceVoxels)] |= word << (voxel % sliceVoxels);
}

void summarize(BlockDistances& block) {
    const Tag tag;
    const IntTag intTag;
    block.known = block.outside = block.inside = block.far = block.mid = {};
    for (int i = 0; i < blockVoxels; i += chunkVoxels) {
        const Vec distance = hn::Sqrt(hn::Load(tag, block.nearest2 + i));
        hn::Store(distance, tag, block.distance + i);
        const auto nearest = hn::Load(intTag, block.nearest + i);
        const Mask known = hn::RebindMask(tag, hn::Gt(nearest, hn::Set(intTag, -1)));
        // A piece at exactly the reach sets its sign bits, but is not stored as nearest.
        const auto has = [&](std::int32_t side) {
            const auto sides = hn::And(nearest, hn::Set(intTag, (1 << sideBits) - 1));
            return hn::And(known, hn::RebindMask(tag, hn::Eq(sides, hn::Set(intTag, side))));
        };
        setBits(known, i, block.known);
        // On the surface either sign is right, and no link can propagate it.
        setBits(hn::Or(has(sideOutside), hn::Lt(distance, hn::Set(tag, 0.5f * linkSlack))), i, block.outside);
        setBits(has(sideInside), i, block.inside);
        setBits(hn::And(known, hn::Gt(distance, hn::Set(tag, farFrom))), i, block.far);
        setBits(hn::And(known, hn::Gt(distance, hn::Set(tag, midFrom))), i, block.mid);
    }
}

bool measureBlock(const BlockInput& input, BlockDistances& block) {
    applySamples(input, block);
    askPieces(input, block);
    summarize(block);
    return any(block.known);
}

void signDistances(const BlockDistances& block, const BlockMask& inside, float* distances) {
    const Tag tag;
    const IntTag intTag;
    for (int i = 0; i < blockVoxels; i += chunkVoxels) {
        const std::uint64_t word = inside[std::size_t(i / sliceVoxels)] >> (i % sliceVoxels);
        std::uint8_t bits[8];
        std::memcpy(bits, &word, sizeof bits);
        const Mask known = hn::RebindMask(tag, hn::Gt(hn::Load(intTag, block.nearest + i), hn::Set(intTag, -1)));
        const Vec distance = hn::IfThenElse(known, hn::Load(tag, block.distance + i), hn::Set(tag, farAway));
        hn::StoreU(hn::IfThenElse(hn::LoadMaskBits(tag, bits), hn::Neg(distance), distance), tag, distances + i);
    }
}

}  // namespace
}  // namespace bilayer::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bilayer::detail {

HWY_EXPORT(measureBlock);
HWY_EXPORT(signDistances);

bool measureBlock(const BlockInput& input, BlockDistances& block) {
    return HWY_DYNAMIC_DISPATCH(measureBlock)(input, block);
}

void signDistances(const BlockDistances& block, const BlockMask& inside, float* distances) {
    HWY_DYNAMIC_DISPATCH(signDistances)(block, inside, distances);
}

}  // namespace bilayer::detail
#endif  // HWY_ONCE
