#include "sdf/mesh/orient.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <numeric>
#include <utility>

#include "sdf/bvh/triangle_tree.h"
#include "sdf/mesh/side_classification.h"
#include "sdf/mesh/topology.h"

namespace bilayer::detail {
namespace {

/// Min ratio of a component's volume to that of a sphere with the same area, above which it separates inside from
/// outside. Closed components only need to exceed rounding errors. Open components need a margin for error; below it
/// they count as open surfaces.
constexpr double minRoundnessClosed = 1e-9;
constexpr double minRoundnessOpen = 1e-2;
/// Count of sample points for the test whether an open component with negative volume bounds a solid as it is. Few
/// points suffice to recognise a majority.
constexpr std::size_t samplesOfPiece = 32;
/// Each pass resolves one level of nested uncertain open components. More than a few passes are not worth the time.
constexpr int maxPasses = 8;

struct OrientedComponent {
    Bounds bounds;
    std::vector<unsigned> triangles;
    std::uint64_t edgeSum = 0;  // zero: closed
    double area = 0, turnedArea = 0;
    double volume = 0;  // as oriented; open components are closed by a cone over the border's centre
    glm::dvec3 borderCentre{0};
    double borderLength = 0;
    bool oneSided = false;
    bool mixed = false;   // some, but not all, of its triangles were flipped for consistency
    bool turned = false;  // flipped as a whole
    bool sheet = false;   // consists of back-to-back faces that enclose nothing; left unchanged

    bool closed() const { return edgeSum == 0; }
    // The apex of the cones whose volumes are summed.
    glm::dvec3 apex() const {
        return borderLength > 0 && !closed() ? borderCentre / borderLength : glm::dvec3(bounds.centre());
    }
    double roundness() const { return 6 * std::sqrt(glm::pi<double>()) * std::abs(volume) / std::pow(area, 1.5); }
    bool bounding() const {
        return !oneSided && !sheet && area > 0 && roundness() > (closed() ? minRoundnessClosed : minRoundnessOpen);
    }
};

class Orienter {
  public:
    Orienter(const Mesh& mesh, Progress* progress)
        : mesh_(mesh), progress_(progress), topology_(mesh, progress), sets_(mesh.triangles.size()) {}

    Orientation run() {
        findSound();
        findDoubled();
        joinNeighbours();
        joinPatches();
        gatherPieces();
        keepMajority();
        measure();
        turnPieces();
        return result();
    }

  private:
    Polled eachTriangle() const { return {mesh_.triangles.size(), progress_}; }

    // Duplicate triangles would hide that an edge has only two triangles. Except in sound bodies, they are ignored and
    // follow their originals.
    bool counts(unsigned triangle) const { return sound_[triangle] || topology_.original[triangle] == triangle; }

    // Finds sound bodies: triangles connected by edges that are all balanced. However many triangles meet at an edge,
    // only the orientation of a whole body can be wrong.
    void findSound() {
        DisjointSets bodies(mesh_.triangles.size());
        topology_.forEachEdge([&](std::span<const EdgeUse> uses) {
            for (const EdgeUse& use : uses) bodies.join(uses[0].triangle, use.triangle);
        });
        const std::vector<std::uint64_t> sums = edgeSums(bodies, [](unsigned) { return true; });
        body_.resize(mesh_.triangles.size());
        sound_.resize(mesh_.triangles.size());
        for (const unsigned i : eachTriangle()) {
            body_[i] = bodies.root(i);
            sound_[i] = sums[body_[i]] == 0;
        }
    }

    // Finds sound bodies in which every face exists twice, back to back. Together the copies enclose nothing, but one
    // half of them may enclose a volume.
    void findDoubled() {
        excess_.assign(mesh_.triangles.size(), 0);
        auto copies = vectorOf<unsigned>(mesh_.triangles.size(), progress_);
        for (const unsigned i : eachTriangle()) {
            excess_[topology_.original[i]] += opposite(i) ? -1 : 1;
            ++copies[topology_.original[i]];
        }
        std::vector<bool> doubled = sound_;
        for (const unsigned i : eachTriangle())
            if (topology_.original[i] == i && topology_.proper(i) && (excess_[i] != 0 || copies[i] != 2))
                doubled[body_[i]] = false;
        doubled_.resize(mesh_.triangles.size());
        for (const unsigned i : eachTriangle()) {
            doubled_[i] = doubled[body_[i]];
            if (doubled_[i]) sound_[i] = false;
        }
    }

    // Copies with the same orientation count as one wall. Equal counts of both orientations cancel out.
    bool encloses(unsigned triangle) const {
        return topology_.original[triangle] == triangle && (!sound_[triangle] || excess_[triangle] != 0);
    }

    bool opposite(unsigned triangle) const {
        const unsigned original = topology_.original[triangle];
        return original != triangle && topology_.facesOpposite(triangle, original);
    }

    std::vector<EdgeUse> countingUses(std::span<const EdgeUse> uses) const {
        std::vector<EdgeUse> some;
        for (const EdgeUse& use : uses)
            if (counts(use.triangle)) some.push_back(use);
        return some;
    }

    void joinNeighbours() {
        topology_.forEachEdge([&](std::span<const EdgeUse> all) {
            if (all.size() < 2) return;
            const std::vector<EdgeUse> uses = countingUses(all);
            if (uses.size() != 2) return;
            const bool agree = uses[0].forward != uses[1].forward;
            if (!sets_.join(uses[0].triangle, uses[1].triangle, !agree)) contradictions_.push_back(uses[0].triangle);
        });
        for (const unsigned i : eachTriangle())
            if (!counts(i)) sets_.join(topology_.original[i], i, doubled_[i] && opposite(i));
    }

    // Joins patches at edges of more than two triangles, if they traverse the edge the same number of times.
    void joinPatches() {
        DisjointSets patches = sets_;
        const std::vector<std::uint64_t> sums = edgeSums(patches, [&](unsigned i) { return counts(i); });
        joinSound(patches, sums);
        topology_.forEachEdge([&](std::span<const EdgeUse> all) {
            if (all.size() < 3 || sound_[all[0].triangle]) return;
            std::vector<std::pair<unsigned, int>> runs;  // open patches and their net count of forward half-edges
            for (const EdgeUse& use : countingUses(all)) {
                const unsigned patch = patches.root(use.triangle);
                if (sums[patch] == 0) continue;
                if (runs.empty() || runs.back().first != patch) runs.emplace_back(patch, 0);
                runs.back().second += patches.oppositeToRoot(use.triangle) ? -use.direction() : use.direction();
            }
            joinAlong(runs);
        });
    }

    // Joins the open patches of a sound body, which keep their relative orientation. Closed patches may be flipped
    // alone.
    void joinSound(DisjointSets& patches, const std::vector<std::uint64_t>& sums) {
        std::vector<unsigned> firstOpen(mesh_.triangles.size(), noPart);
        for (const unsigned i : eachTriangle()) {
            if (!sound_[i] || sums[patches.root(i)] == 0) continue;
            unsigned& first = firstOpen[body_[i]];
            if (first == noPart) first = i;
            sets_.join(first, i);
        }
    }

    void joinAlong(std::vector<std::pair<unsigned, int>>& runs) {
        std::sort(runs.begin(), runs.end());
        std::vector<std::pair<unsigned, int>> merged;
        int sum = 0;
        for (const auto& [patch, count] : runs) {
            if (merged.empty() || merged.back().first != patch) merged.emplace_back(patch, 0);
            merged.back().second += count;
            sum += count;
        }
        std::erase_if(merged, [](const auto& run) { return run.second == 0; });
        if (merged.size() == 2 && std::abs(merged[0].second) == std::abs(merged[1].second))
            sets_.join(merged[0].first, merged[1].first, merged[0].second == merged[1].second);
        else if (sum == 0)
            for (std::size_t i = 1; i < merged.size(); ++i) sets_.join(merged[0].first, merged[i].first);
    }

    // Returns for each set, at its root, zero if its triangles, flipped relative to the root as stored, form a closed
    // surface.
    template <class Takes>
    std::vector<std::uint64_t> edgeSums(DisjointSets& sets, Takes takes) const {
        const std::vector<std::uint64_t> vertices = hashVertices(mesh_, progress_);
        auto sums = vectorOf<std::uint64_t>(mesh_.triangles.size(), progress_);
        for (const unsigned i : eachTriangle()) {
            if (!takes(i)) continue;
            const glm::uvec3& t = mesh_.triangles[i];
            const std::uint64_t a = vertices[t.x], b = vertices[t.y], c = vertices[t.z];
            const std::uint64_t sum = hashEdge(a, b) + hashEdge(b, c) + hashEdge(c, a);
            sums[sets.root(i)] += sets.oppositeToRoot(i) ? 0 - sum : sum;
        }
        return sums;
    }

    void gatherPieces() {
        const std::vector<std::uint64_t> sums = edgeSums(sets_, [&](unsigned i) { return counts(i); });
        pieceOf_.assign(mesh_.triangles.size(), 0);
        turned_.assign(mesh_.triangles.size(), false);
        for (const unsigned i : eachTriangle()) {
            const unsigned root = sets_.root(i);
            // a root is the smallest number of its set, so it comes first
            if (root == i) {
                pieceOf_[i] = unsigned(pieces_.size());
                pieces_.emplace_back().edgeSum = sums[i];
            }
            pieceOf_[i] = pieceOf_[root];
            turned_[i] = sets_.oppositeToRoot(i);
            pieces_[pieceOf_[i]].triangles.push_back(i);
        }
        for (const unsigned triangle : contradictions_) pieces_[pieceOf_[triangle]].oneSided = true;
        findSheets();
    }

    // A doubled body is a solid only if all of its components are closed.
    void findSheets() {
        std::vector<bool> open(mesh_.triangles.size());
        const auto pieceOf = [&](unsigned i) -> OrientedComponent& { return pieces_[pieceOf_[i]]; };
        for (const unsigned i : eachTriangle())
            if (pieceOf(i).oneSided || !pieceOf(i).closed()) open[body_[i]] = true;
        for (const unsigned i : eachTriangle()) pieceOf(i).sheet = doubled_[i] && open[body_[i]];
    }

    glm::dvec3 point(unsigned triangle, int k) const { return mesh_.points[mesh_.triangles[triangle][k]]; }

    glm::dvec3 areaVector(unsigned i) const {
        return 0.5 * glm::cross(point(i, 1) - point(i, 0), point(i, 2) - point(i, 0));
    }

    void keepMajority() {
        for (const unsigned i : eachTriangle()) {
            OrientedComponent& piece = pieces_[pieceOf_[i]];
            const double area = glm::length(areaVector(i));
            piece.area += area;
            if (turned_[i]) piece.turnedArea += area;
            piece.mixed |= turned_[i] && topology_.proper(i);
            for (int k = 0; k < 3; ++k) piece.bounds.add(mesh_.points[mesh_.triangles[i][k]]);
        }
        for (OrientedComponent& piece : pieces_) {
            if (piece.oneSided || piece.sheet) {
                for (const unsigned i : piece.triangles) turned_[i] = false;
                piece.mixed = false;
            } else if (piece.turnedArea > 0.5 * piece.area)
                flip(piece);
        }
    }

    void flip(OrientedComponent& piece) {
        for (const unsigned i : piece.triangles) turned_[i] = !turned_[i];
        piece.volume = -piece.volume;
    }

    void measure() {
        findBorders();
        for (const unsigned i : eachTriangle()) {
            if (!counts(i)) continue;
            OrientedComponent& piece = pieces_[pieceOf_[i]];
            const double volume = glm::dot(areaVector(i), point(i, 0) - piece.apex()) / 3;
            piece.volume += turned_[i] ? -volume : volume;
        }
    }

    // Finds the unbalanced edges of each component, and sums them weighted by length.
    void findBorders() {
        topology_.forEachEdge([&](std::span<const EdgeUse> uses) {
            const glm::dvec3 a = mesh_.points[uses[0].low], b = mesh_.points[uses[0].high];
            for (const EdgeUse& use : uses) {
                int net = 0;
                for (const EdgeUse& other : uses)
                    if (counts(other.triangle) && pieceOf_[other.triangle] == pieceOf_[use.triangle])
                        net += turned_[other.triangle] ? -other.direction() : other.direction();
                if (net == 0) continue;
                OrientedComponent& piece = pieces_[pieceOf_[use.triangle]];
                const double length = glm::length(b - a);
                piece.borderCentre += 0.5 * length * (a + b);
                piece.borderLength += length;
            }
        });
    }

    // Flips components from the outermost inward. The box of a component lies within the boxes of those around it.
    void turnPieces() {
        std::vector<unsigned> bounding, partOf(mesh_.triangles.size(), noPart);
        for (unsigned p = 0; p < pieces_.size(); ++p)
            if (pieces_[p].bounding()) bounding.push_back(p);
        std::stable_sort(bounding.begin(), bounding.end(), [&](unsigned a, unsigned b) {
            return glm::length(pieces_[a].bounds.size()) > glm::length(pieces_[b].bounds.size());
        });
        for (const unsigned p : bounding)
            for (const unsigned i : pieces_[p].triangles)
                if (encloses(i)) partOf[i] = p;
        if (bounding.empty()) return;
        const TriangleTree tree(mesh_, progress_);
        const auto enclosing = enclosingParts(mesh_, tree, partOf, pieces_.size(), progress_);
        const Sides sides(mesh_, tree, progress_);
        for (const unsigned p : bounding)
            if (wrong(pieces_[p], enclosing[p]) && !standsRight(pieces_[p], sides)) {
                flip(pieces_[p]);
                pieces_[p].turned = true;
            }
    }

    bool wrong(const OrientedComponent& piece, const std::vector<unsigned>& enclosing) const {
        int winding = 0;
        bool trusted = !piece.mixed;
        for (const unsigned outer : enclosing) {
            winding += pieces_[outer].volume > 0 ? 1 : -1;
            trusted &= !pieces_[outer].mixed && !pieces_[outer].turned;
        }
        return winding <= 0 ? piece.volume < 0 : !trusted && piece.volume > 0;
    }

    // An open component may be the wall of a bore, with the solid on the other side. The rest of the mesh then decides.
    static bool standsRight(const OrientedComponent& piece, const Sides& sides) {
        return !piece.closed() && !piece.mixed && sides.measure(piece.triangles, samplesOfPiece).solid > 0.5;
    }

    Orientation result() const {
        Orientation orientation;
        orientation.mesh.points = mesh_.points;
        orientation.mesh.origin = mesh_.origin;
        poll(progress_);
        orientation.mesh.triangles = mesh_.triangles;
        for (const unsigned i : eachTriangle()) {
            if (!turned_[i]) continue;
            std::swap(orientation.mesh.triangles[i].y, orientation.mesh.triangles[i].z);
            ++orientation.turnedTriangles;
        }
        for (const OrientedComponent& piece : pieces_) {
            orientation.mixedComponents += piece.mixed;
            orientation.turnedComponents += piece.turned && !piece.mixed;
            if (piece.oneSided && !piece.sheet) orientation.oneSidedTriangles += piece.triangles.size();
        }
        return orientation;
    }

    const Mesh& mesh_;
    Progress* progress_;
    Topology topology_;
    DisjointSets sets_;                     // of triangles; opposite members: exactly one of the two must be flipped
    std::vector<unsigned> body_;            // for each triangle: the first triangle connected with it by edges
    std::vector<bool> sound_;               // for each triangle: all edges of its body are balanced
    std::vector<int> excess_;               // for each original: copies with its orientation minus opposite ones
    std::vector<bool> doubled_;             // for each triangle: its body has each face twice, back to back
    std::vector<unsigned> contradictions_;  // triangles at edges where a one-sided surface meets itself reversed
    std::vector<OrientedComponent> pieces_;
    std::vector<unsigned> pieceOf_;  // for each triangle
    std::vector<bool> turned_;       // for each triangle
};

std::size_t countDifferent(const Mesh& a, const Mesh& b) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < a.triangles.size(); ++i) count += a.triangles[i] != b.triangles[i];
    return count;
}

}  // namespace

Orientation orient(const Mesh& mesh, Progress* progress) {
    validate(mesh);
    Orientation all = Orienter(mesh, progress).run();
    // open components are judged by their surroundings, which the previous pass may have flipped
    for (int pass = 1; pass < maxPasses && all.turnedTriangles > 0; ++pass) {
        const Orientation next = Orienter(all.mesh, progress).run();
        if (next.turnedTriangles == 0) break;
        all.mesh = next.mesh;
        all.turnedComponents += next.turnedComponents;
    }
    all.turnedTriangles = countDifferent(mesh, all.mesh);
    return all;
}

}  // namespace bilayer::detail
