// The side of a voxel by the angle-weighted normal of its closest feature: sdf/sign/closest_side.h on a device, in
// double precision.
#include "piece_distances.cl"

// See sdf/sign/closest_side.cpp, and sideSlack of sdf/fill/exact.cpp.
#define SAME_PLACE 1e-7
#define FLATNESS 1e-10
#define CANCELLED 1e-2
#define SIDE_SLACK 1e-3f
// Maximum faces that meet in the closest point of a voxel; with more of them the host decides.
#define MOST_FACES 48

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
        if (distance(c[i], p) <= SAME_PLACE) {
            const double3 a = c[(i + 1) % 3] - c[i], b = c[(i + 2) % 3] - c[i];
            return atan2(length(cross(a, b)), dot(a, b));
        }
    for (int i = 0; i < 3; ++i) {
        const double3 edge = c[(i + 1) % 3] - c[i];
        if (length(cross(edge, p - c[i])) <= SAME_PLACE * length(edge)) return M_PI;
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
    double3 from;  // [voxels]
} View;

Corners seen(const View* view, uint triangle) {
    Corners t = cornersOf(view->points, view->triangles, triangle, view->voxelsPerUnit);
    t.a -= view->from;
    t.b -= view->from;
    t.c -= view->from;
    return t;
}

// Triangles that may be nearest to a point.
typedef struct {
    uint triangle[MOST_FACES];
    int count;
    bool all;  // no triangle was left out because of the limit
    double nearest;
    double3 closest;  // the point of the nearest of them
} Faces;

void offer(Faces* faces, const View* view, uint triangle) {
    for (int i = 0; i < faces->count; ++i)
        if (faces->triangle[i] == triangle) return;
    const Corners t = seen(view, triangle);
    const double3 closest = closestToOrigin(&t);
    const double away = length(closest);
    if (away > faces->nearest + SAME_PLACE) return;
    if (away < faces->nearest) {
        // the nearest ones so far may be farther
        if (away < faces->nearest - SAME_PLACE) faces->count = 0;
        faces->nearest = away;
        faces->closest = closest;
    }
    if (faces->count == MOST_FACES)
        faces->all = false;
    else
        faces->triangle[faces->count++] = triangle;
}

// ClosestSide::side() of sdf/sign/closest_side.cpp: negative inside, positive outside, zero where the normals at the
// closest point cancel or there are too many.
double sideBy(const Faces* faces, const View* view) {
    double sum = 0, weights = 0;
    for (int i = 0; i < faces->count; ++i) {
        const Corners t = seen(view, faces->triangle[i]);
        const double3 closest = closestToOrigin(&t), ab = t.b - t.a, ac = t.c - t.a, bc = t.c - t.b,
                      normal = cross(ab, ac);
        const double size = length(normal), longest = sqrt(max(dot(ab, ab), max(dot(ac, ac), dot(bc, bc))));
        // a triangle thinner than the tolerance has no reliable normal
        if (distance(closest, faces->closest) > SAME_PLACE || size <= SAME_PLACE * longest) continue;
        bool duplicate = false;
        for (int j = 0; j < i; ++j) {
            const Corners other = seen(view, faces->triangle[j]);
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
double sideOf(const Input* input, uint piece, View* view, int voxel) {
    const int3 at = (int3)(voxel / 64, voxel / 8 % 8, voxel % 8);
    view->from = convert_double3(input->near.block + at);
    Faces faces;
    faces.count = 0;
    faces.all = true;
    faces.nearest = INFINITY;
    offer(&faces, view, input->pieces[piece].triangle);
    const float3 place = input->near.inBrick + convert_float3(at);
    const float away = (float)(faces.nearest) + SIDE_SLACK;
    global const float* radii = input->near.groups.columns + RADIUS * input->near.groups.stride;
    for (uint c = input->near.range.x; c < input->near.range.y; ++c) {
        if (distance(place, placeOf(&input->near.groups, c)) > away + radii[c]) continue;
        for (uint m = input->near.groups.begins[c]; m < input->near.groups.begins[c + 1]; ++m) {
            global const Member* member = input->members + m;
            if (distance(place, vload3(0, member->place)) <= away + member->radius)
                offer(&faces, view, input->pieces[member->content].triangle);
        }
    }
    return sideBy(&faces, view);
}
