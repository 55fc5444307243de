#include "demos/shared/machines.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/gtc/constants.hpp>
#include <set>
#include <stdexcept>
#include <string>

namespace bilayer::shapes {
namespace {

constexpr double pi = glm::pi<double>();

constexpr int segmentStep = 24;  // puts vertices on the corners of hexagons and squares
constexpr int minAround = 6;     // vertices of the smallest ring around a pole, so that its triangles are equilateral
// In edge lengths: rows of a thread that come closer to its end than this are dropped.
constexpr double nearestRow = 0.4;
constexpr double mouthWidth = 1.05;              // of a nut [diameters]: ISO 4032 allows 1 to 1.08
const double mouthSlope = std::sqrt(3.0);        // mean slope of a nut's opening: that of a 120 degree countersink
constexpr double addendum = 1, dedendum = 1.25;  // ISO 53, profile A [modules]
const double flankRise = std::sqrt(3.0);         // slope of a thread's flank, 30 degrees from the radial plane
const double threadHeight = 5.0 / 16 * std::sqrt(3.0);  // from crest to root, 5/8 H [pitches]

void require(bool met, const char* what) {
    if (!met) throw std::invalid_argument(what);
}

void requireSegments(int segments) {
    require(segments > 0 && segments % segmentStep == 0, "a round part needs a multiple of 24 segments");
}

// Smooth step from 0 at `low` to 1 at `high`, with zero slope at both.
double smoothStep(double low, double high, double x) {
    const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
    return t * t * (3 - 2 * t);
}

int cellsOf(double length, double edge) {
    return std::max(1, int(std::lround(length / edge)));
}

glm::vec3 aroundAxis(double radius, double angle, double height) {
    return glm::vec3(glm::dvec3(radius * std::cos(angle), radius * std::sin(angle), height));
}

// A vertex in a row, with its position in the row as the key.
struct Link {
    unsigned vertex;
    double key;
};
using Row = std::vector<Link>;

unsigned addPoint(Mesh& mesh, const glm::vec3& point) {
    mesh.points.push_back(point);
    return unsigned(mesh.points.size() - 1);
}

// Fills the space between two rows of ascending keys with triangles, always advancing to the lower key; `b` is to the
// left of `a`. On equal keys, `b` advances first. The diagonals on the curved flanks of a thread then cut into the
// flanks and never add material.
void zip(Mesh& mesh, const Row& a, const Row& b) {
    std::size_t i = 0, j = 0;
    while (i + 1 < a.size() || j + 1 < b.size())
        if (j + 1 == b.size() || (i + 1 < a.size() && a[i + 1].key < b[j + 1].key)) {
            mesh.triangles.push_back({a[i].vertex, a[i + 1].vertex, b[j].vertex});
            ++i;
        } else {
            mesh.triangles.push_back({a[i].vertex, b[j + 1].vertex, b[j].vertex});
            ++j;
        }
}

// Radius as a function of the angle.
using Outline = std::function<double(double)>;

Outline round(double radius) {
    return [=](double) { return radius; };
}

// Returns a circle whose `segments` chords stay outside of the radius.
Outline roundHole(double radius, int segments) {
    return round(radius / std::cos(pi / segments));
}

// Returns a regular polygon; one of its sides faces +x.
Outline polygon(int sides, double apothem) {
    return [=](double angle) { return apothem / std::cos(std::remainder(angle, 2 * pi / sides)); };
}

// A closed curve around z.
struct Level {
    Outline radius;
    double height;
    int count;  // count of vertices; 1: a pole

    // Returns the length of its edges.
    double edge() const { return 2 * pi * radius(0) / count; }
};

Level pole(double height) {
    return {round(0), height, 1};
}

// Returns curves between two others, excluding the first, at a spacing of about their edge length.
std::vector<Level> between(const Level& from, const Level& to) {
    double length = 0;
    for (int i = 0; i < segmentStep; ++i) {
        const double angle = 2 * pi * i / segmentStep;
        length = std::max(length, std::hypot(to.radius(angle) - from.radius(angle), to.height - from.height));
    }
    const bool pole = from.count == 1 || to.count == 1;
    const int cells = cellsOf(length, (from.edge() + to.edge()) / (pole ? 1 : 2));
    std::vector<Level> levels;
    for (int i = 1; i < cells; ++i) {
        const double t = double(i) / cells;
        const auto radius = [=](double angle) { return (1 - t) * from.radius(angle) + t * to.radius(angle); };
        const int count = int(std::lround((1 - t) * from.count + t * to.count));
        levels.push_back({radius, (1 - t) * from.height + t * to.height, std::max(minAround, count)});
    }
    levels.push_back(to);
    return levels;
}

// Builds a surface around z, curve by curve: outward on bottom faces, up on outer walls, inward on top faces, down in
// holes.
class Lathe {
  public:
    explicit Lathe(Mesh& mesh) : mesh_(mesh) {}

    // Starts at a curve without joining it to anything.
    const Row& begin(const Level& level) { return begin(level, addRow(level)); }
    const Row& begin(const Level& level, const Row& row) {
        level_ = level;
        return row_ = row;
    }

    // Continues to a curve, through intermediate ones.
    const Row& to(const Level& level) { return to(level, nullptr); }
    const Row& to(const Level& level, const Row* last) {
        const auto levels = between(level_, level);
        for (const Level& next : levels) {
            const Row row = last && &next == &levels.back() ? *last : addRow(next);
            zip(mesh_, row_, row);
            row_ = row;
        }
        level_ = level;
        return row_;
    }

  private:
    // The row starts at the same angle as the previous one.
    Row addRow(const Level& level) {
        Row row;
        const double start = row_.empty() ? 0 : row_.front().key;
        for (int i = 0; i < level.count; ++i) {
            const double turn = start + double(i) / level.count, angle = 2 * pi * turn;
            row.push_back({addPoint(mesh_, aroundAxis(level.radius(angle), angle, level.height)), turn});
        }
        if (level.count > 1) row.push_back({row.front().vertex, start + 1});
        return row;
    }

    Mesh& mesh_;
    Level level_{};
    Row row_;
};

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

// Extrudes a planar mesh at z = 0 that faces up into a prism centred on that plane.
Mesh extrude(const Mesh& flat, double height, double edge) {
    const int layers = cellsOf(height, edge);
    const auto size = unsigned(flat.points.size());
    Mesh mesh;
    for (int layer = 0; layer <= layers; ++layer)
        for (const auto& point : flat.points)
            mesh.points.push_back({point.x, point.y, float(height * (double(layer) / layers - 0.5))});

    std::set<std::pair<unsigned, unsigned>> edges;
    for (const auto& t : flat.triangles) {
        mesh.triangles.push_back({t.x, t.z, t.y});
        mesh.triangles.push_back(t + unsigned(layers) * size);
        for (int k = 0; k < 3; ++k) edges.insert({t[k], t[(k + 1) % 3]});
    }
    for (const auto& [from, to] : edges) {
        if (edges.count({to, from})) continue;
        for (int layer = 0; layer < layers; ++layer) {
            const unsigned low = unsigned(layer) * size, high = low + size;
            mesh.triangles.push_back({low + from, low + to, high + to});
            mesh.triangles.push_back({low + from, high + to, high + from});
        }
    }
    return weld(mesh);  // removes the inner points that the layers repeat
}

// The outline of a tooth: radii, and half of its angle there.
struct ToothStation {
    double radius, halfAngle;
};

// Returns the outline from root to tip: radially up to the base circle, then along the involute.
std::vector<ToothStation> toothStations(const Gear& part) {
    const double pitchRadius = part.teeth * double(part.toothModule) / 2;
    const double base = pitchRadius * std::cos(double(part.pressureAngle));
    const double root = pitchRadius - dedendum * part.toothModule, tip = pitchRadius + addendum * part.toothModule;
    const double thickness = pi * part.toothModule / 2 - double(part.backlash) / 2;
    // length of the unwound string, in base radii; 0 at the base circle
    const auto unwound = [&](double radius) { return std::sqrt(std::max(0.0, radius * radius / (base * base) - 1)); };
    const auto involute = [](double string) { return string - std::atan(string); };
    const double halfAtBase = thickness / (2 * pitchRadius) + involute(unwound(pitchRadius));

    std::vector<ToothStation> stations;
    const double edge = double(part.edge) / 2;
    if (root < base)
        for (int i = 0, cells = cellsOf(base - root, edge); i < cells; ++i)
            stations.push_back({root + (base - root) * i / cells, halfAtBase});
    // the arc length of an involute is half the squared string length
    const double low = std::pow(unwound(std::max(root, base)), 2), high = std::pow(unwound(tip), 2);
    const int cells = cellsOf(base * (high - low) / 2, edge);
    for (int i = 0; i <= cells; ++i) {
        const double string = std::sqrt(low + (high - low) * i / cells);
        stations.push_back({base * std::hypot(1, string), halfAtBase - involute(string)});
    }
    return stations;
}

// Adds a row of vertices across a tooth, from one flank to the other.
Row addAcross(Mesh& mesh, const ToothStation& at, double middle, int cells) {
    Row row;
    for (int i = 0; i <= cells; ++i) {
        const double angle = middle + at.halfAngle * (2.0 * i / cells - 1);
        row.push_back({addPoint(mesh, aroundAxis(at.radius, angle, 0)), double(i)});
    }
    return row;
}

// Adds all teeth. Returns the vertices of the root circle in order.
Row addTeeth(Mesh& mesh, const Gear& part) {
    const auto stations = toothStations(part);
    require(stations.back().halfAngle > 0, "a gear's teeth must not end in a point");
    const double root = stations.front().radius, half = stations.front().halfAngle, step = 2 * pi / part.teeth;
    require(step > 2 * half, "a gear's teeth must leave a gap at their roots");
    const int across = cellsOf(2 * half * root, part.edge);
    const int land = cellsOf((step - 2 * half) * root, part.edge);

    Row circle;
    for (int tooth = 0; tooth < part.teeth; ++tooth) {
        Row below = addAcross(mesh, stations.front(), tooth * step, across);
        for (int i = 0; i <= across; ++i)
            circle.push_back({below[std::size_t(i)].vertex, (tooth * step + half * (2.0 * i / across - 1)) / (2 * pi)});
        for (std::size_t i = 1; i < stations.size(); ++i) {
            const Row above = addAcross(mesh, stations[i], tooth * step, across);
            zip(mesh, above, below);
            below = above;
        }
        for (int i = 1; i < land; ++i) {
            const double angle = tooth * step + half + (step - 2 * half) * i / land;
            circle.push_back({addPoint(mesh, aroundAxis(root, angle, 0)), angle / (2 * pi)});
        }
    }
    circle.push_back({circle.front().vertex, circle.front().key + 1});
    return circle;
}

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
    lathe.begin(pole(-part.headHeight));
    lathe.to({round(profile.crest), -part.headHeight, n});
    lathe.to({hexagon, -part.headHeight, n});
    lathe.to({hexagon, 0, n});
    const Row bearing = lathe.to({round(profile.crest), 0, n});
    const Row tip = lathe.begin({round(profile.root), length, n});
    lathe.to(pole(length));

    ThreadedWall wall{0, length, pitch, edge, profile.rows(pitch, edge), {}};
    const double end = wall.plainEnd(), start = std::max(plain, end);
    require(length > start + pitch + depth + end, "a bolt must be longer than its thread runs out");
    wall.radius = [&](double phase, double z) {
        const double groove = smoothStep(start, start + pitch, z) * (profile.crest - profile.radius(phase));
        return profile.root + smoothStep(end, end + depth, length - z) * (depth - groove);
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
        const double widened = 1 - smoothStep(end, end + depth, half - std::abs(z)), r = profile.radius(phase);
        return roundHole(r + widened * (mouth - r), n)(0);
    };
    wall.add(mesh, bottom, top, true);
    return mesh;
}

Pose onThread(const Thread& thread, float height) {
    const float turns = height / thread.pitch;
    return {{0, 0, height}, glm::angleAxis(2 * glm::pi<float>() * (turns - std::floor(turns)), glm::vec3(0, 0, 1))};
}

Mesh gear(const Gear& part) {
    require(part.toothModule > 0 && part.faceWidth > 0 && part.edge > 0 && part.backlash >= 0,
            "a gear's dimensions must be positive");
    require(part.teeth * std::pow(std::sin(double(part.pressureAngle)), 2) >= 2,
            "a gear of so few teeth would need an undercut");
    const double root = (part.teeth / 2.0 - dedendum) * part.toothModule, bore = double(part.bore) / 2;
    require(bore > 0 && bore < root, "a gear's bore must be narrower than its root circle");

    Mesh flat;
    const Row circle = addTeeth(flat, part);
    Lathe lathe(flat);
    lathe.begin({round(root), 0, int(circle.size() - 1)}, circle);
    const int around = std::max(minAround, cellsOf(2 * pi * bore, part.edge));
    lathe.to({roundHole(bore, around), 0, around});
    return extrude(flat, part.faceWidth, part.edge);
}

float meshingAngle(const Gear& gear, float angle, const Gear& mate, float direction) {
    const double ratio = double(mate.teeth) / gear.teeth;
    return float(direction + pi + pi / gear.teeth - (double(angle) - direction) * ratio);
}

Mesh peg(const Peg& part) {
    requireSegments(part.segments);
    const double r = (double(part.diameter) - part.clearance) / 2, half = double(part.length) / 2, c = part.chamfer;
    require(c >= 0 && r > c && half > c, "a peg must be larger than its chamfers");

    Mesh mesh;
    const int n = part.segments;
    Lathe lathe(mesh);
    lathe.begin(pole(-half));
    lathe.to({round(r - c), -half, n});
    if (c > 0) lathe.to({round(r), c - half, n});
    lathe.to({round(r), half - c, n});
    if (c > 0) lathe.to({round(r - c), half, n});
    lathe.to(pole(half));
    return mesh;
}

Mesh holedBlock(const HoledBlock& part) {
    requireSegments(part.segments);
    const double r = double(part.diameter) / 2, half = double(part.height) / 2, c = part.chamfer, floor = part.floor;
    require(c >= 0 && r > 0 && part.width / 2 > r + c, "a block must be wider than its hole");
    require(floor >= 0 && part.height > floor + 2 * c, "a block must be higher than its floor and chamfers");

    Mesh mesh;
    const int n = part.segments;
    const Outline square = polygon(4, double(part.width) / 2), hole = roundHole(r, n), mouth = roundHole(r + c, n);
    const Level under{mouth, -half, n};
    Lathe lathe(mesh);
    if (floor > 0) lathe.begin(pole(-half));
    const Row first = floor > 0 ? lathe.to(under) : lathe.begin(under);
    lathe.to({square, -half, n});
    lathe.to({square, half, n});
    lathe.to({mouth, half, n});
    if (c > 0) lathe.to({hole, half - c, n});
    if (floor > 0) {
        lathe.to({hole, floor - half, n});
        lathe.to(pole(floor - half));
    } else {
        if (c > 0) lathe.to({hole, c - half, n});
        lathe.to(under, &first);
    }
    return mesh;
}

Mesh pole(const Pole& part) {
    requireSegments(part.segments);
    const double r = part.radius, foot = part.footRadius, shoulder = double(part.height) - r;
    require(r > 0 && foot > r && part.footHeight > 0, "a pole's foot must be wider than the pole");
    require(shoulder > part.footHeight, "a pole must be higher than its foot and its round top");

    Mesh mesh;
    const int n = part.segments, arc = n / 4;
    Lathe lathe(mesh);
    lathe.begin(pole(0));
    lathe.to({round(foot), 0, n});
    lathe.to({round(foot), part.footHeight, n});
    lathe.to({round(r), part.footHeight, n});
    lathe.to({round(r), shoulder, n});
    for (int i = 1; i < arc; ++i) {
        const double angle = pi / 2 * i / arc, ring = r * std::cos(angle);
        lathe.to({round(ring), shoulder + r * std::sin(angle), std::max(minAround, int(n * std::cos(angle)))});
    }
    lathe.to(pole(part.height));
    return mesh;
}

std::vector<Pose> chain(int links, float major, float minor, float slack) {
    const float step = 2 * (major - minor) - slack;
    require(minor > 0 && slack >= 0 && step > major && step > 2 * minor, "a chain's neighbours must be linked");
    std::vector<Pose> poses;
    for (int i = 0; i < links; ++i) {
        const glm::vec3 across = i % 2 == 0 ? glm::vec3(1, 0, 0) : glm::vec3(0, 1, 0);
        poses.push_back({{0, 0, -step * float(i)}, glm::angleAxis(glm::half_pi<float>(), across)});
    }
    return poses;
}

}  // namespace bilayer::shapes
