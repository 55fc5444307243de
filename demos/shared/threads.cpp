// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/threads.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/gtc/constants.hpp>

#include "demos/shared/lathe.h"

namespace bilayer::shapes {

using namespace detail;

namespace {

// In edge lengths: rows of a thread that come closer to its end than this are dropped.
constexpr double nearestRow = 0.4;
constexpr double mouthWidth = 1.05;        // of a nut [diameters]: ISO 4032 allows 1 to 1.08
const double mouthSlope = std::sqrt(3.0);  // mean slope of a nut's opening: that of a 120 degree countersink

const double flankRise = std::sqrt(3.0);                // slope of a thread's flank, 30 degrees from the radial plane
const double threadHeight = 5.0 / 16 * std::sqrt(3.0);  // from crest to root, 5/8 H [pitches]

// Smooth step from 0 at `low` to 1 at `high`, with zero slope at both.
double smoothRise(double low, double high, double x) {
    const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
    return t * t * (3 - 2 * t);
}

// The axial section of a thread. `phase` is the distance from the middle of a crest [pitches].
struct Profile {
    double crest, root;          // radii [m]
    double crestEnd, rootStart;  // phases at the ends of the flank

    // The profile of ISO 68-1, offset inward by the clearance.
    Profile(const Thread& thread, double clearance) {
        require(thread.pitch > 0 && thread.diameter > 2 * thread.pitch,
                "a thread needs a pitch below half its diameter");
        const double shift = clearance / flankRise / thread.pitch;
        crest = double(thread.diameter) / 2 - clearance;
        root = crest - threadHeight * thread.pitch;
        crestEnd = 1.0 / 16 - shift;
        rootStart = 6.0 / 16 - shift;
        require(clearance >= 0 && crestEnd > 0,
                "a thread's clearance must leave some of its crest: 0.1 pitches at most");
    }

    double radius(double phase) const {
        const double t = (std::abs(phase) - crestEnd) / (rootStart - crestEnd);
        return crest + std::clamp(t, 0.0, 1.0) * (root - crest);
    }

    // Returns the phases of rows along the thread from one crest to the next: at all edges, and at about the given
    // spacing.
    std::vector<double> rows(double pitch, double edge) const {
        const double ends[] = {-crestEnd, crestEnd, rootStart, 1 - rootStart, 1 - crestEnd};
        std::vector<double> phases;
        for (int part = 0; part < 4; ++part) {
            const double width = ends[part + 1] - ends[part];
            const double rise = part % 2 == 1 ? (crest - root) / pitch : 0;
            const int cells = cellsOf(std::hypot(width, rise) * pitch, edge);
            for (int i = 0; i < cells; ++i) phases.push_back(ends[part] + width * i / cells);
        }
        return phases;
    }
};

// A threaded surface between two circles with equal counts of vertices, given by the radius as a function of phase
// [pitches] and height. Its rows of vertices run along the thread, so that its edges stay as sharp as the profile's.
// The rows begin and end at the circles. Near the circles, up to the length plainEnd(), the radius must not depend on
// the phase. Otherwise the triangles that join the last row to the circle would cross grooves.
struct ThreadedWall {
    double bottom, top, pitch, edge;
    std::vector<double> phases;
    std::function<double(double phase, double height)> radius;

    double plainEnd() const {
        double widest = phases.front() + 1 - phases.back();
        for (std::size_t i = 1; i < phases.size(); ++i) widest = std::max(widest, phases[i] - phases[i - 1]);
        return widest * pitch + nearestRow * edge;
    }

    double height(long row, double turn) const {
        const long size = long(phases.size()), crest = row >= 0 ? row / size : (row + 1) / size - 1;
        return pitch * (double(crest) + phases[std::size_t(row - crest * size)] + turn);
    }

    // Returns the vertices above a position on the circles, from one circle to the other, with their rows as keys.
    Row column(Mesh& mesh, const Link& low, const Link& high) const {
        const long size = long(phases.size());
        const long first = size * long(std::floor(bottom / pitch - 2)), last = size * long(std::ceil(top / pitch + 1));
        Row column{{low.vertex, 0}};  // the first key is never used
        for (long row = first; row < last; ++row) {
            const double z = height(row, low.key), phase = phases[std::size_t((row - first) % size)];
            if (z < bottom + nearestRow * edge || z > top - nearestRow * edge) continue;
            const double r = radius(phase > 0.5 ? phase - 1 : phase, z);
            column.push_back({addPoint(mesh, aroundAxis(r, 2 * pi * low.key, z)), double(row)});
        }
        column.push_back({high.vertex, column.back().key + 1});
        return column;
    }

    void add(Mesh& mesh, const Row& low, const Row& high, bool inside) const {
        std::vector<Row> columns;
        for (std::size_t i = 0; i + 1 < low.size(); ++i) columns.push_back(column(mesh, low[i], high[i]));
        // after one revolution, the rows have climbed by one pitch
        columns.push_back(columns.front());
        for (Link& link : columns.back()) link.key -= double(phases.size());
        for (std::size_t i = 0; i + 1 < columns.size(); ++i)
            inside ? zip(mesh, columns[i], columns[i + 1]) : zip(mesh, columns[i + 1], columns[i]);
    }
};

}  // namespace

Mesh bolt(const Bolt& part) {
    requireSegments(part.segments);
    const Thread& thread = part.thread;
    const Profile profile(thread, thread.clearance);
    const double pitch = thread.pitch, length = part.length, plain = part.plain, depth = profile.crest - profile.root;
    require(plain >= 0 && part.headHeight > 0 && part.acrossFlats > thread.diameter,
            "a bolt's head must be wider than its shank");

    Mesh mesh;
    const int n = part.segments;
    const double edge = 2 * pi * profile.crest / n;
    const Outline hexagon = polygon(6, double(part.acrossFlats) / 2);
    Lathe lathe(mesh);
    lathe.begin(apex(-part.headHeight));
    lathe.to({round(profile.crest), -part.headHeight, n});
    lathe.to({hexagon, -part.headHeight, n});
    lathe.to({hexagon, 0, n});
    const Row bearing = lathe.to({round(profile.crest), 0, n});
    const Row tip = lathe.begin({round(profile.root), length, n});
    lathe.to(apex(length));

    ThreadedWall wall{0, length, pitch, edge, profile.rows(pitch, edge), {}};
    const double end = wall.plainEnd(), start = std::max(plain, end);
    require(length > start + pitch + depth + end, "a bolt must be longer than its thread runs out");
    wall.radius = [&](double phase, double z) {
        const double groove = smoothRise(start, start + pitch, z) * (profile.crest - profile.radius(phase));
        return profile.root + smoothRise(end, end + depth, length - z) * (depth - groove);
    };
    wall.add(mesh, bearing, tip, false);
    return mesh;
}

Mesh nut(const Nut& part) {
    requireSegments(part.segments);
    const Thread& thread = part.thread;
    const Profile profile(thread, 0);
    const double half = double(part.height) / 2, mouth = mouthWidth * thread.diameter / 2;
    require(part.acrossFlats / 2 > mouth, "a nut must be wider than its mouths");

    Mesh mesh;
    const int n = part.segments;
    const double edge = 2 * pi * profile.crest / n;
    const Outline hexagon = polygon(6, double(part.acrossFlats) / 2), hole = roundHole(mouth, n);
    Lathe lathe(mesh);
    const Row bottom = lathe.begin({hole, -half, n});
    lathe.to({hexagon, -half, n});
    lathe.to({hexagon, half, n});
    const Row top = lathe.to({hole, half, n});

    ThreadedWall wall{-half, half, thread.pitch, edge, profile.rows(thread.pitch, edge), {}};
    const double end = wall.plainEnd(), depth = (mouth - profile.root) / mouthSlope;
    require(half > end + depth, "a nut must be higher than its mouths are deep");
    wall.radius = [&](double phase, double z) {
        const double widened = 1 - smoothRise(end, end + depth, half - std::abs(z)), r = profile.radius(phase);
        return roundHole(r + widened * (mouth - r), n)(0);
    };
    wall.add(mesh, bottom, top, true);
    return mesh;
}

Pose onThread(const Thread& thread, float height) {
    const float turns = height / thread.pitch;
    return {{0, 0, height}, glm::angleAxis(2 * glm::pi<float>() * (turns - std::floor(turns)), glm::vec3(0, 0, 1))};
}

}  // namespace bilayer::shapes
