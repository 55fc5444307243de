// SPDX-License-Identifier: Apache-2.0
// Samples a field that is laid out as in collider/field/layout/field_layout.h. Does the same operations as
// collider/field/samples/field_sample.cpp.
#include "layout.cl"

// [voxels]
#define CELL_DIAGONAL 1.7320508f
#define ROUND_DOWN (1 - 0x1p-22)
// Bits of a coordinate below the voxel, which leave room for those of the voxel in its block in the same word. Adding
// the second number moves a fixed-point number to the lower bits of a double below 2^22.
#define FRACTION_BITS 29
#define FIXED_POINT 12582912.0

// Sample of collider/query.h.
typedef struct {
    float distance, gradient[3];
    uchar inBand;
} Sample;

typedef struct {
    Frame frame;
    global const int* directory;
    global const char* centres;
    global const float* values;
} Field;

// The voxels around a point at its lower and its upper x: (y, z), (y, z + 1), (y + 1, z), (y + 1, z + 1).
typedef struct {
    float4 low, high;
} Cell;

int3 blocksOf(const Field* field) {
    return vload3(0, field->frame.blocks);
}

// The distance [m] and its gradient [m per voxel].
float4 interpolate(const Cell* cell, float3 fraction) {
    const float4 dx = cell->high - cell->low, at = cell->low + fraction.x * dx;
    // values at z and z + 1, then their changes along x
    const float4 y0 = (float4)(at.lo, dx.lo), y1 = (float4)(at.hi, dx.hi);
    const float4 dy = y1 - y0, along = y0 + fraction.y * dy;
    // value, along x, along y
    const float3 z0 = (float3)(along.even, dy.x), z1 = (float3)(along.odd, dy.y);
    const float3 dz = z1 - z0;
    return (float4)(z0 + fraction.z * dz, dz.x);
}

// Bound of the interpolation error [voxels].
float interpolationError(float3 fraction) {
    const float3 spread = fraction * (1.0f - fraction);
    return sqrt(spread.x + spread.y + spread.z);
}

// Clearance::around() [voxels].
float clearanceAt(const Field* field, double3 position) {
    const double3 point = position / (double)(COARSE_SIDE);
    const int3 size = BLOCK_SIDE / COARSE_SIDE * blocksOf(field);
    const int3 part = min(convert_int3(clamp(point, (double3)(0.0), convert_double3(size))), size - 1);
    const double3 offset = point - (convert_double3(part) + 0.5);
    const float length = (float)(sqrt(offset.x * offset.x + offset.y * offset.y + offset.z * offset.z));
    const float centre = (float)(field->centres[centreOf(part, blocksOf(field))]) * (1.0f / CLEARANCE_STEPS);
    return (float)(COARSE_SIDE) * (fabs(centre) - length);
}

// The bound for points outside of the directory's box, and for coordinates that are not numbers.
float boundOutside(const Field* field, double3 position, double3 extent) {
    const double3 offset = position - clamp(position, (double3)(0.0), extent);
    const double length = sqrt(offset.x * offset.x + offset.y * offset.y + offset.z * offset.z);
    if (!isfinite(length)) return INFINITY;
    const Frame* frame = &field->frame;
    const double bound =
        (length - (double)(CELL_DIAGONAL)) * (double)(frame->voxelSize) + (double)(frame->exteriorWidth);
    return (float)(clamp(ROUND_DOWN * bound, 0.0, (double)(FLT_MAX)));
}

float boundInEmptyBlock(const Field* field, bool inside, double3 position) {
    const Frame* frame = &field->frame;
    const double3 rest = position - (double)(BLOCK_SIDE)*floor(position / (double)(BLOCK_SIDE));
    const bool ownCell = max(max(rest.x, rest.y), rest.z) <= (double)(BLOCK_SIDE - 1);
    const float width = inside ? frame->interiorWidth : frame->exteriorWidth;
    const float nextToBand = width - (ownCell ? 0.5f : 1.0f) * CELL_DIAGONAL * frame->voxelSize;
    const float bound = max(0.0f, max(nextToBand, frame->voxelSize * clearanceAt(field, position)));
    return inside ? -bound : bound;
}

Cell cellAt(const Field* field, int entry, int3 inBlock) {
    global const float* v = field->values + voxelOf(entry, inBlock);
    const int x = STRIDE * STRIDE, y = STRIDE;
    const Cell cell = {(float4)(v[0], v[1], v[y], v[y + 1]), (float4)(v[x], v[x + 1], v[x + y], v[x + y + 1])};
    return cell;
}

bool isInBand(const Field* field, const Cell* cell) {
    const float lower = -field->frame.interiorWidth, upper = field->frame.exteriorWidth;
    return all(cell->low > lower && cell->low < upper && cell->high > lower && cell->high < upper);
}

// Replaces values that are not numbers in the host's layout by the band's widths.
float4 withWidths(const Frame* frame, float4 values) {
    const float4 widths = select((float4)(frame->exteriorWidth), (float4)(-frame->interiorWidth), signbit(values));
    return select(values, widths, isnan(values));
}

// The bound in a cell with a voxel beyond the band.
float boundNextToBand(const Field* field, float distance, double3 position) {
    const Frame* frame = &field->frame;
    const float nextToBand =
        (distance < 0 ? frame->interiorWidth : frame->exteriorWidth) - CELL_DIAGONAL * frame->voxelSize;
    const float within =
        fabs(distance) - frame->voxelSize * interpolationError(convert_float3(position - floor(position)));
    const float known = max(within, frame->voxelSize * clearanceAt(field, position));
    return copysign(max(0.0f, max(nextToBand, known)), distance);
}

Sample beyondBand(float distance) {
    const Sample sample = {distance, {0, 0, 0}, 0};
    return sample;
}

Sample sampleAt(const Field* field, float3 point) {
    const Frame* frame = &field->frame;
    const double3 origin = vload3(0, frame->origin);
    const double3 fixed = convert_double3(point) * frame->perMetre + (FIXED_POINT - origin * frame->perMetre);
    // the upper words are blocks, the lower ones positions in them; negative, huge and non-numeric values are beyond
    // all blocks
    const ulong3 words = as_ulong3(fixed);
    const uint3 block = convert_uint3(words >> 32) - (uint)(as_ulong(FIXED_POINT) >> 32);
    const uint3 inBlock = convert_uint3(words & 0xffffffffUL);
    const double3 position = (convert_double3(point) - origin) * frame->perMetre;
    if (any(block >= convert_uint3(blocksOf(field))))
        return beyondBand(boundOutside(field, position, convert_double3(BLOCK_SIDE * blocksOf(field))));

    const int entry = field->directory[indexOf(convert_int3(block), blocksOf(field))];
    if (entry < 0) return beyondBand(boundInEmptyBlock(field, entry == EMPTY_INSIDE, position));

    const int3 bits = convert_int3(inBlock & ((1u << FRACTION_BITS) - 1));
    const float3 fraction = convert_float3(bits) * (1.0f / (1 << FRACTION_BITS));
    Cell cell = cellAt(field, entry, convert_int3(inBlock >> FRACTION_BITS));
    const bool inBand = isInBand(field, &cell);
    if (!inBand) {
        cell.low = withWidths(frame, cell.low);
        cell.high = withWidths(frame, cell.high);
    }
    const float4 found = interpolate(&cell, fraction);
    if (!inBand) return beyondBand(boundNextToBand(field, found.x, position));
    const float3 gradient = found.yzw * (float)(frame->perMetre);
    const Sample sample = {found.x, {gradient.x, gradient.y, gradient.z}, 1};
    return sample;
}

// A work-item samples some consecutive points: one on GPUs, whose items run side by side.
kernel void sampleField(Frame frame, global const int* directory, global const char* centres,
                        global const float* values, global const float* points, uint count, uint pointsPerItem,
                        global Sample* samples) {
    const Field field = {frame, directory, centres, values};
    const uint first = (uint)(get_global_id(0)) * pointsPerItem, last = min(count, first + pointsPerItem);
    for (uint i = first; i < last; ++i) samples[i] = sampleAt(&field, vload3(i, points));
}
