// SPDX-License-Identifier: Apache-2.0
// Samples points of bodies in the fields of other bodies. Does the same operations as
// collider/contact/search/points_in_field.h. A bounding sphere of points that is certainly far from the other body is culled.
#include "field.cl"

// How far the interpolant may be below the distance [voxels], and a generous bound of the rounding of a bounding
// sphere. Points that are not culled are sampled.
#define MAX_INTERPOLATION_ERROR 0.87f
#define BALL_ROUNDING 0.01f

// The offsets of a body in the shared buffers.
typedef struct {
    Frame frame;
    ulong directory, centres, values, points, balls;
} Body;

typedef struct {
    float linear[9], shift[3], scale, reach;
    uint body, other;
    uint firstBall;  // index over all queries
} Query;

typedef struct {
    float centre[3], radius;
    uint begin, end;
} Ball;

typedef struct {
    uint query, point;
    float distance, gradient[3];
    uint inBand;
} FoundPoint;

// Applies an affine map, given by its columns.
float3 mapped(const Query* query, float3 p) {
    const float3 a = vload3(0, query->linear), b = vload3(1, query->linear), c = vload3(2, query->linear);
    return a * p.x + b * p.y + c * p.z + vload3(0, query->shift);
}

// The query of a bounding sphere of the batch.
uint queryOf(global const Query* queries, uint count, uint ball) {
    uint low = 0, high = count;
    while (low + 1 < high) {
        const uint middle = (low + high) / 2;
        if (queries[middle].firstBall <= ball)
            low = middle;
        else
            high = middle;
    }
    return low;
}

// Whether a sphere is certainly outside, farther than `radius` from the surface: Clearance::isOutside() [coarse cells].
bool isOutside(const Field* field, float3 centre, float radius) {
    const int3 size = COARSE_ALONG * blocksOf(field);
    const float3 inBox = clamp(centre, (float3)(0.0f), convert_float3(size));
    const float3 toBox = centre - inBox;
    if (dot(toBox, toBox) > radius * radius) return true;
    const int3 cell = min(convert_int3(inBox), size - 1);
    const float3 toCentre = centre - (convert_float3(cell) + 0.5f);
    const float clearance =
        (float)(field->centres[centreOf(cell, blocksOf(field))]) * (1.0f / CLEARANCE_STEPS) - radius;
    return clearance > 0 && dot(toCentre, toCentre) < clearance * clearance;
}

bool mayBeWithinReach(const Field* field, const Query* query, const Ball* ball) {
    const Frame* frame = &field->frame;
    const float perCell = (float)(frame->perMetre) / (float)(COARSE_SIDE);
    const double3 place = convert_double3(mapped(query, vload3(0, ball->centre))) - vload3(0, frame->origin);
    const float reach = query->reach * perCell + MAX_INTERPOLATION_ERROR / (float)(COARSE_SIDE) + BALL_ROUNDING;
    return !isOutside(field, convert_float3(place) * perCell, ball->radius * query->scale * perCell + reach);
}

// A work-item tests some consecutive bounding spheres: one on GPUs. Answers beyond the capacity are counted only.
kernel void samplePoints(global const Body* bodies, global const Query* queries, uint queryCount, uint ballCount,
                         uint ballsPerItem, global const int* directories, global const char* centres,
                         global const float* values, global const float* points, global const Ball* balls,
                         uint capacity, global uint* count, global FoundPoint* found) {
    const uint first = (uint)(get_global_id(0)) * ballsPerItem, last = min(ballCount, first + ballsPerItem);
    if (first >= last) return;
    uint at = queryOf(queries, queryCount, first);
    for (uint i = first; i < last; ++i) {
        while (at + 1 < queryCount && queries[at + 1].firstBall <= i) ++at;
        const Query query = queries[at];
        global const Body* other = bodies + query.other;
        global const Body* body = bodies + query.body;
        const Field field = {other->frame, directories + other->directory, centres + other->centres,
                             values + other->values};
        const Ball ball = balls[body->balls + (i - query.firstBall)];
        if (!mayBeWithinReach(&field, &query, &ball)) continue;
        global const float* own = points + 3 * body->points;
        for (uint p = ball.begin; p < ball.end; ++p) {
            const Sample sample = sampleAt(&field, mapped(&query, vload3(p, own)));
            if (!(sample.distance <= query.reach) || (!sample.inBand && !(sample.distance < 0))) continue;
            const uint place = atomic_inc(count);
            if (place >= capacity) continue;
            const FoundPoint answer = {
                at, p, sample.distance, {sample.gradient[0], sample.gradient[1], sample.gradient[2]}, sample.inBand};
            found[place] = answer;
        }
    }
}
