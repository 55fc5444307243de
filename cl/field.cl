// Samples of a field that is laid out as in sdf/field_layout.h: what Field::sample() does in collider/field.cpp,
// operation by operation.
#include "layout.cl"

// [voxels]
#define CELL_DIAGONAL 1.7320508f

// Sample of sdf/sample.h.
typedef struct {
    float distance, gradient[3];
    uchar inBand;
} Sample;

typedef struct {
    Frame frame;
    global const int* directory;
    global const Part* parts;
    global const float* values;
} Field;

// The eight voxels around a point, the last axis fastest, and where the point lies between them.
typedef struct {
    float values[8];
    float3 fraction;
} Cell;

int3 blocksOf(const Field* field) {
    return vload3(0, field->frame.blocks);
}

// mix() may round otherwise.
float between(float a, float b, float t) {
    return a + t * (b - a);
}

float interpolate(const Cell* cell) {
    const float* v = cell->values;
    const float3 f = cell->fraction;
    const float low = between(between(v[0], v[1], f.z), between(v[2], v[3], f.z), f.y);
    const float high = between(between(v[4], v[5], f.z), between(v[6], v[7], f.z), f.y);
    return between(low, high, f.x);
}

// The gradient of interpolate() [distance a voxel].
float3 interpolantGradient(const Cell* cell) {
    const float* v = cell->values;
    const float3 f = cell->fraction;
    const float x0y0 = between(v[0], v[1], f.z), x0y1 = between(v[2], v[3], f.z);
    const float x1y0 = between(v[4], v[5], f.z), x1y1 = between(v[6], v[7], f.z);
    return (float3)(between(x1y0, x1y1, f.y) - between(x0y0, x0y1, f.y), between(x0y1 - x0y0, x1y1 - x1y0, f.x),
                    between(between(v[1] - v[0], v[3] - v[2], f.y), between(v[5] - v[4], v[7] - v[6], f.y), f.x));
}

// What the interpolant may be off by [voxels].
float interpolationError(float3 fraction) {
    const float3 spread = fraction * (1.0f - fraction);
    return sqrt(spread.x + spread.y + spread.z);
}

// Clearance::around() [voxels].
float clearanceAt(const Field* field, double3 place) {
    const float3 point = convert_float3(place) / (float)(PART_SIDE);
    const int3 size = BLOCK_SIDE / PART_SIDE * blocksOf(field);
    const int3 part = min(convert_int3(clamp(point, (float3)(0.0f), convert_float3(size))), size - 1);
    const float3 way = point - (convert_float3(part) + 0.5f);
    const float length = sqrt(way.x * way.x + way.y * way.y + way.z * way.z);
    return (float)(PART_SIDE) * (fabs(field->parts[indexOf(part, size)].centre) - length);
}

// The bound for points outside of the directory's box, or that are nowhere.
float boundOutside(const Field* field, double3 place, double3 extent) {
    const double3 way = place - clamp(place, (double3)(0.0), extent);
    const double length = sqrt(way.x * way.x + way.y * way.y + way.z * way.z);
    if (!isfinite(length)) return INFINITY;
    const Frame* frame = &field->frame;
    return max(0.0f, (float)(length - (double)(CELL_DIAGONAL)) * frame->voxelSize + frame->exteriorWidth);
}

float boundInEmptyBlock(const Field* field, bool inside, double3 place, int3 block) {
    const Frame* frame = &field->frame;
    const float3 inBlock = convert_float3(place - convert_double3(BLOCK_SIDE * block));
    const bool ownCell = max(max(inBlock.x, inBlock.y), inBlock.z) <= (float)(BLOCK_SIDE - 1);
    const float width = inside ? frame->interiorWidth : frame->exteriorWidth;
    const float besideBand = width - (ownCell ? 0.5f : 1.0f) * CELL_DIAGONAL * frame->voxelSize;
    const float bound = max(0.0f, max(besideBand, frame->voxelSize * clearanceAt(field, place)));
    return inside ? -bound : bound;
}

Cell cellAt(const Field* field, int entry, int3 inBlock, float3 fraction) {
    global const float* v = field->values + voxelOf(entry, inBlock);
    const int x = STRIDE * STRIDE, y = STRIDE;
    const Cell cell = {{v[0], v[1], v[y], v[y + 1], v[x], v[x + 1], v[x + y], v[x + y + 1]}, fraction};
    return cell;
}

bool isInBand(const Field* field, const Cell* cell) {
    float low = cell->values[0], high = low;
    for (int i = 1; i < 8; ++i) {
        low = min(low, cell->values[i]);
        high = max(high, cell->values[i]);
    }
    return low > -field->frame.interiorWidth && high < field->frame.exteriorWidth;
}

// The bound in a cell of which a voxel is beyond the band.
float boundBesideBand(const Field* field, const Cell* cell, float distance, double3 place) {
    const Frame* frame = &field->frame;
    const float besideBand =
        (distance < 0 ? frame->interiorWidth : frame->exteriorWidth) - CELL_DIAGONAL * frame->voxelSize;
    const float within = fabs(distance) - frame->voxelSize * interpolationError(cell->fraction);
    const float known = max(within, frame->voxelSize * clearanceAt(field, place));
    return copysign(max(0.0f, max(besideBand, known)), distance);
}

Sample beyondBand(float distance) {
    const Sample sample = {distance, {0, 0, 0}, 0};
    return sample;
}

Sample sampleAt(const Field* field, float3 point) {
    const Frame* frame = &field->frame;
    const double3 place = (convert_double3(point) - vload3(0, frame->origin)) * frame->perMetre;
    const double3 extent = (double)(BLOCK_SIDE)*convert_double3(blocksOf(field));
    // compared before any conversion to integers, so that NaN and huge coordinates end here
    if (!all(place >= 0.0) || !all(place < extent)) return beyondBand(boundOutside(field, place, extent));

    const int3 voxel = convert_int3(place), block = voxel >> 3;
    const int entry = field->directory[indexOf(block, blocksOf(field))];
    if (entry < 0) return beyondBand(boundInEmptyBlock(field, entry == EMPTY_INSIDE, place, block));

    const Cell cell = cellAt(field, entry, voxel & 7, convert_float3(place - convert_double3(voxel)));
    const float distance = interpolate(&cell);
    if (!isInBand(field, &cell)) return beyondBand(boundBesideBand(field, &cell, distance, place));
    const float3 gradient = interpolantGradient(&cell) * (float)(frame->perMetre);
    const Sample sample = {distance, {gradient.x, gradient.y, gradient.z}, 1};
    return sample;
}

// A work-item samples some points in a row: one on GPUs, whose items stand side by side.
kernel void sampleField(Frame frame, global const int* directory, global const Part* parts, global const float* values,
                        global const float* points, uint count, uint pointsPerItem, global Sample* samples) {
    const Field field = {frame, directory, parts, values};
    const uint first = (uint)(get_global_id(0)) * pointsPerItem, last = min(count, first + pointsPerItem);
    for (uint i = first; i < last; ++i) samples[i] = sampleAt(&field, vload3(i, points));
}
