// SPDX-License-Identifier: Apache-2.0
// The side of a voxel by the angle-weighted normal of its closest feature: sdf/sign/closest_side.h on a device, in
// double precision.
#include "piece_distances.cl"

// See sdf/sign/closest_side.cpp, and sideSlack of sdf/fill/exact.cpp.
#define SAME_POINT 1e-7
#define FLATNESS 1e-10
#define CANCELLED 1e-2
#define SIDE_SLACK 1e-3f
// Maximum faces that meet in the closest point of a voxel; with more of them the host decides.
#define MAX_FACES 48

double3 closestOnSegment(double3 a, double3 b) {
    const double3 ab = b - a;
    const double length2 = dot(ab, ab);
    const double t = length2 > 0 ? clamp(-dot(a, ab) / length2, 0.0, 1.0) : 0.0;
    // from the nearer end, so that both triangles of an edge find the same point for either direction of the edge
    return t <= 0.5 ? a + t * ab : b - (1 - t) * ab;
}

// The point of a triangle that is closest to the origin. Correct for triangles without area too.
double3 closestToOrigin(const Corners* t) {
    const double3 ab = t->b - t->a, ac = t->c - t->a, bc = t->c - t->b, n = cross(ab, ac);
    const double n2 = dot(n, n), longest2 = max(dot(ab, ab), max(dot(ac, ac), dot(bc, bc)));
    // inside all three edges: the foot on the plane
    if (n2 > FLATNESS * FLATNESS * longest2 * longest2 && dot(cross(ab, -t->a), n) >= 0 &&
        dot(cross(bc, -t->b), n) >= 0 && dot(cross(-ac, -t->c), n) >= 0)
        return dot(t->a, n) / n2 * n;
    double3 best = closestOnSegment(t->a, t->b);
    const double3 second = closestOnSegment(t->b, t->c), third = closestOnSegment(t->c, t->a);
    if (dot(second, second) < dot(best, best)) best = second;
    if (dot(third, third) < dot(best, best)) best = third;
    return best;
}

// The angle of a triangle at one of its points: the full angle inside, half of it on an edge.
double angleAt(const Corners* t, double3 p) {
    const double3 c[3] = {t->a, t->b, t->c};
    for (int i = 0; i < 3; ++i)
        if (distance(c[i], p) <= SAME_POINT) {
            const double3 a = c[(i + 1) % 3] - c[i], b = c[(i + 2) % 3] - c[i];
            return atan2(length(cross(a, b)), dot(a, b));
        }
    for (int i = 0; i < 3; ++i) {
        const double3 edge = c[(i + 1) % 3] - c[i];
        if (length(cross(edge, p - c[i])) <= SAME_POINT * length(edge)) return M_PI;
    }
    return 2 * M_PI;
}

bool sameCorners(const Corners* s, const Corners* t) {
    return (all(s->a == t->a) && all(s->b == t->b) && all(s->c == t->c)) ||
           (all(s->a == t->b) && all(s->b == t->c) && all(s->c == t->a)) ||
           (all(s->a == t->c) && all(s->b == t->a) && all(s->c == t->b));
}

// The mesh relative to a point.
typedef struct {
    global const float* points;
    global const uint* triangles;
    double voxelsPerUnit;
    double3 origin;  // [voxels]
} RelativeMesh;

Corners relativeCorners(const RelativeMesh* mesh, uint triangle) {
    Corners t = cornersOf(mesh->points, mesh->triangles, triangle, mesh->voxelsPerUnit);
    t.a -= mesh->origin;
    t.b -= mesh->origin;
    t.c -= mesh->origin;
    return t;
}

// Triangles that may be nearest to a point.
typedef struct {
    uint triangle[MAX_FACES];
    int count;
    bool all;  // no triangle was left out because of the limit
    double nearest;
    double3 closest;  // the point of the nearest of them
} Faces;

void addFace(Faces* faces, const RelativeMesh* mesh, uint triangle) {
    for (int i = 0; i < faces->count; ++i)
        if (faces->triangle[i] == triangle) return;
    const Corners t = relativeCorners(mesh, triangle);
    const double3 closest = closestToOrigin(&t);
    const double faceDistance = length(closest);
    if (faceDistance > faces->nearest + SAME_POINT) return;
    if (faceDistance < faces->nearest) {
        // the nearest ones so far may be farther
        if (faceDistance < faces->nearest - SAME_POINT) faces->count = 0;
        faces->nearest = faceDistance;
        faces->closest = closest;
    }
    if (faces->count == MAX_FACES)
        faces->all = false;
    else
        faces->triangle[faces->count++] = triangle;
}

// ClosestSide::side() of sdf/sign/closest_side.cpp: negative inside, positive outside, zero where the normals at the
// closest point cancel or there are too many.
double pseudonormalSide(const Faces* faces, const RelativeMesh* mesh) {
    double sum = 0, weights = 0;
    for (int i = 0; i < faces->count; ++i) {
        const Corners t = relativeCorners(mesh, faces->triangle[i]);
        const double3 closest = closestToOrigin(&t), ab = t.b - t.a, ac = t.c - t.a, bc = t.c - t.b,
                      normal = cross(ab, ac);
        const double size = length(normal), longest = sqrt(max(dot(ab, ab), max(dot(ac, ac), dot(bc, bc))));
        // a triangle thinner than the tolerance has no reliable normal
        if (distance(closest, faces->closest) > SAME_POINT || size <= SAME_POINT * longest) continue;
        bool duplicate = false;
        for (int j = 0; j < i; ++j) {
            const Corners other = relativeCorners(mesh, faces->triangle[j]);
            duplicate = duplicate || sameCorners(&other, &t);
        }
        if (duplicate) continue;
        const double angle = angleAt(&t, faces->closest);
        sum -= angle * dot(normal / size, faces->closest);
        weights += angle;
    }
    return !faces->all || fabs(sum) <= CANCELLED * weights * faces->nearest ? 0 : sum;
}

// The side of a voxel of a block, from all pieces that may be as near as its nearest one, `piece`.
double sideOf(const Input* input, uint piece, RelativeMesh* mesh, int voxel) {
    const int3 at = (int3)(voxel / 64, voxel / 8 % 8, voxel % 8);
    mesh->origin = convert_double3(input->nearby.block + at);
    Faces faces;
    faces.count = 0;
    faces.all = true;
    faces.nearest = INFINITY;
    addFace(&faces, mesh, input->pieces[piece].triangle);
    const float3 position = input->nearby.inBrick + convert_float3(at);
    const float limit = (float)(faces.nearest) + SIDE_SLACK;
    global const float* radii = input->nearby.groups.columns + RADIUS * input->nearby.groups.stride;
    for (uint c = input->nearby.range.x; c < input->nearby.range.y; ++c) {
        if (distance(position, positionOf(&input->nearby.groups, c)) > limit + radii[c]) continue;
        for (uint m = input->nearby.groups.begins[c]; m < input->nearby.groups.begins[c + 1]; ++m) {
            global const Member* member = input->members + m;
            if (distance(position, vload3(0, member->position)) <= limit + member->radius)
                addFace(&faces, mesh, input->pieces[member->content].triangle);
        }
    }
    return pseudonormalSide(&faces, mesh);
}
