// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/gears.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "demos/shared/lathe.h"

namespace bilayer::shapes {

using namespace detail;

namespace {

constexpr double addendum = 1, dedendum = 1.25;  // ISO 53, profile A [modules]

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

}  // namespace bilayer::shapes
