// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/machines.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/constants.hpp>

#include "demos/shared/lathe.h"

namespace bilayer::shapes {

using namespace detail;

Mesh peg(const Peg& part) {
    requireSegments(part.segments);
    const double r = (double(part.diameter) - part.clearance) / 2, half = double(part.length) / 2, c = part.chamfer;
    require(c >= 0 && r > c && half > c, "a peg must be larger than its chamfers");

    Mesh mesh;
    const int n = part.segments;
    Lathe lathe(mesh);
    lathe.begin(apex(-half));
    lathe.to({round(r - c), -half, n});
    if (c > 0) lathe.to({round(r), c - half, n});
    lathe.to({round(r), half - c, n});
    if (c > 0) lathe.to({round(r - c), half, n});
    lathe.to(apex(half));
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
    if (floor > 0) lathe.begin(apex(-half));
    const Row first = floor > 0 ? lathe.to(under) : lathe.begin(under);
    lathe.to({square, -half, n});
    lathe.to({square, half, n});
    lathe.to({mouth, half, n});
    if (c > 0) lathe.to({hole, half - c, n});
    if (floor > 0) {
        lathe.to({hole, floor - half, n});
        lathe.to(apex(floor - half));
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
    lathe.begin(apex(0));
    lathe.to({round(foot), 0, n});
    lathe.to({round(foot), part.footHeight, n});
    lathe.to({round(r), part.footHeight, n});
    lathe.to({round(r), shoulder, n});
    for (int i = 1; i < arc; ++i) {
        const double angle = pi / 2 * i / arc, ring = r * std::cos(angle);
        lathe.to({round(ring), shoulder + r * std::sin(angle), std::max(minAround, int(n * std::cos(angle)))});
    }
    lathe.to(apex(part.height));
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
