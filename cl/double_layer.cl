// The double layer method on a device: the samples of sdf/layer_samples.h, applied as sdf/layer_block.cpp does it.
//
// -D TRIANGLES=1 also keeps whose sample is the nearest; -D PAPER_CUBE=1 replaces the ball around a sample by the
// paper's cube of (2 K + 1)^3 voxels.
#include "samples.cl"

#ifndef TRIANGLES
#define TRIANGLES 0
#endif
#ifndef PAPER_CUBE
#define PAPER_CUBE 0
#endif

// What stays in registers: a cube of 4x4x4 voxels, a vector for each slice of one x, or a GPU's row of 8.
#if ITEMS > 1
#define SLICES 1
#define CUBES 1
typedef float Slices;  // a number for each slice
#define sliceOf(numbers, i) (numbers)
#else
#define SLICES 4
#define CUBES 8
typedef float4 Slices;  // a number for each slice
#define sliceOf(numbers, i) (i == 0 ? numbers.x : i == 1 ? numbers.y : i == 2 ? numbers.z : numbers.w)
#endif

// layerTie of sdf/blocks.h [voxels^2].
#define LAYER_TIE 1e-5f
// Groups with fewer runs than this are applied without a look at what they could improve.
#define RUNS_WORTH_A_LOOK 5

#if defined(FP_FAST_FMAF) || defined(__FMA__)
#define multiplyAdd fma
#else
#define multiplyAdd(a, b, c) ((a) * (b) + (c))
#endif

// FillParameters of sdf/blocks.h [voxels].
typedef struct {
    float delta, reach, certain;
    int cube;
} Layers;

// Bricks into runs of samples and groups of them. Work-groups take the bricks one after another, so that few need
// scratch memory.
GROUP_KERNEL void prepareBricks(global const float* points, global const uint* triangles, Grid grid,
                                global const uint* cellOfBrick, global const uint* triangleOffsets,
                                global const uint* partOffsets, global const uint* list, uint firstBrick, uint bricks,
                                global float* samples, global Run* unsorted, global Run* runs,
                                global uint* cellOfRun, global float* groupColumns, global uint* groupBegins,
                                uint stride, global uint* scratch, uint scratchCells, global uint2* ranges,
                                global uint* next, Layers layers) {
    SHARED uint taken, counts[2];
    SHARED Extent extents[ITEMS];
    SHARED uint2 sums[ITEMS];
    const Groups groups = {groupColumns, groupBegins, stride};
    const int side = 1 << grid.shift, slices = side / BLOCK_SIDE;
    const float reach = (float)(grid.reach), twiceDelta = 2 * layers.delta;
    for (;;) {
        MEET;
        if (ITEM == 0) {
            taken = atomic_inc(next);
            counts[RUNS] = counts[SAMPLES] = 0;
        }
        MEET;
        if (taken >= bricks) return;
        const uint b = firstBrick + taken, first = partOffsets[b] - partOffsets[firstBrick];
        const int3 brick = brickAt(&grid, cellOfBrick[b]);
        const Limits limits = limitsOf(&grid, brick);
        Cut cut = {samples + 3 * (size_t)(first), unsorted + first,
                   counts,                        first,
                   convert_double3(brick * side), -reach,
                   (float)(side - 1) + reach,     twiceDelta,
                   noExtent()};
        cutTriangles(&cut, &grid, points, triangles, list, triangleOffsets[b], triangleOffsets[b + 1], &limits);
        extents[ITEM] = cut.extent;
        MEET;
        const uint found = counts[RUNS];
        const Extent all = sumExtents(extents);
        uint groupCount = found;
        bool gathered = all.sizes < (double)(2 * SMALL_AREA) * found;
        if (gathered) {
            const Cells cells = makeCells(&all, CELL_SIZE);
            gathered = countCells(&cells) <= (float)(scratchCells);
            if (gathered)
                groupCount = sortMembers(&groups, first, (global const Member*)(unsorted + first),
                                         (global Member*)(runs + first), cellOfRun + first, found, &cells,
                                         scratch + get_group_id(0) * scratchCells, sums);
        }
        for (uint g = first + ITEM; g < first + groupCount; g += ITEMS) {
            if (gathered) {
                groupRuns(&groups, g, samples, runs);
            } else {
                runs[g] = unsorted[g];
                groups.begins[g] = g;
                groupRun(&groups, g, samples, runs + g, twiceDelta);
            }
        }
        if (ITEM == 0 && !gathered) groups.begins[first + found] = first + found;
        MEET;
        rangeGroups(&groups, first, groupCount, slices, reach, ranges + taken * slices);
    }
}

// What was found for the voxels of a cube: squared distances to both layers less delta^2, and whose samples these are.
typedef struct {
    Lanes inner2[SLICES], outer2[SLICES];
#if TRIANGLES
    IntLanes innerOwner[SLICES], outerOwner[SLICES];
#endif
} Found;

// Where the voxels of a cube are, in the voxels of the brick.
typedef struct {
    Slices x;
    Lanes y, z;
} Voxels;

// The first voxel of an item's cube, in the block.
float3 cornerOf(int cube) {
#if ITEMS > 1
    (void)(cube);
    return (float3)((float)(ITEM / BLOCK_SIDE), (float)(ITEM % BLOCK_SIDE), 0);
#else
    return (float)(SLICES) * (float3)((float)(cube / 4), (float)(cube / 2 % 2), (float)(cube % 2));
#endif
}

Voxels voxelsOf(float3 first) {
#if ITEMS > 1
    const Voxels v = {first.x, first.y, first.z + (Lanes)(0, 1, 2, 3, 4, 5, 6, 7)};
#else
    const float4 row = (float4)(0, 1, 2, 3), one = 1.0f;
    const Voxels v = {first.x + row, first.y + (Lanes)(0 * one, one, 2 * one, 3 * one),
                      first.z + (Lanes)(row, row, row, row)};
#endif
    return v;
}

// The lattice point nearest to a sample. Halves go up, whatever the rounding: LayerSamples::nearestLattice().
float3 nearestLattice(float3 place) {
    return floor(place + 0.5001f);
}

// Squared distances from a cube's voxels to a sample: along x for each slice, and across. Infinite outside of the
// paper's cube, if that is asked for.
typedef struct {
    Slices along, along2;
    Lanes y, z, across2;
} Measured;

INLINED Measured measure(const Voxels* v, float3 place, int k) {
    Measured m;
    m.along = v->x - place.x;
    m.along2 = m.along * m.along;
    m.y = v->y - place.y;
    m.z = v->z - place.z;
    m.across2 = multiplyAdd(m.y, m.y, m.z * m.z);
    if (PAPER_CUBE) {
        const float3 centre = nearestLattice(place);
        const Lanes away = max(fabs(v->y - centre.y), fabs(v->z - centre.z));
        m.across2 = select((Lanes)(INFINITY), m.across2, away <= (float)(k));
        m.along2 = select((Slices)(INFINITY), m.along2, fabs(v->x - centre.x) <= (float)(k));
    }
    return m;
}

INLINED void applyRun(Found* found, const Voxels* v, global const float* samples, global const Run* run, int k) {
    const float3 normal = vload3(0, run->twiceOffset);
    const uint count = sampleCount(run);
    Lanes nearest2[SLICES];
    const Measured first = measure(v, vload3(0, run->place), k);
    UNROLLED for (int i = 0; i < SLICES; ++i) nearest2[i] = sliceOf(first.along2, i) + first.across2;
    for (uint s = 1; s < count; ++s) {
        const Measured next = measure(v, sampleOf(samples, run, s), k);
        UNROLLED for (int i = 0; i < SLICES; ++i) nearest2[i] = min(nearest2[i], sliceOf(next.along2, i) + next.across2);
    }
    // 2 delta times the height over the plane
    const Slices along = first.along * normal.x;
    const Lanes across = multiplyAdd(first.y, (Lanes)(normal.y), first.z * normal.z);
    UNROLLED for (int i = 0; i < SLICES; ++i) {
        const Lanes height = sliceOf(along, i) + across;
        const Lanes inner2 = nearest2[i] + height, outer2 = nearest2[i] - height;
#if TRIANGLES
        found->innerOwner[i] = select(found->innerOwner[i], (IntLanes)(run->triangle), inner2 < found->inner2[i]);
        found->outerOwner[i] = select(found->outerOwner[i], (IntLanes)(run->triangle), outer2 < found->outer2[i]);
#endif
        found->inner2[i] = min(found->inner2[i], inner2);
        found->outer2[i] = min(found->outer2[i], outer2);
    }
}

// Whether a ball may hold a sample nearer to some voxel than what was found: |p - centre| - radius < bound.
INLINED bool mayImprove(const Voxels* v, float3 centre, float radius, float delta2, const Lanes* bound, const Lanes* best2) {
    const float rest = delta2 + radius * radius;
    const Lanes dy = v->y - centre.y, dz = v->z - centre.z, across2 = multiplyAdd(dy, dy, dz * dz);
    const Slices dx = v->x - centre.x, along2 = dx * dx;
    IntLanes may = 0;
    UNROLLED for (int i = 0; i < SLICES; ++i) {
        const Lanes distance2 = sliceOf(along2, i) + across2;
        may |= distance2 < multiplyAdd((Lanes)(2 * radius), bound[i], best2[i]) + rest;
    }
    return anyLane(may);
}

// What a block works from.
typedef struct {
    Near near;
    global const float* samples;
    global const Run* runs;
    Layers layers;
} Input;

float3 offsetOf(const Groups* groups, uint g) {
    global const float* columns = groups->columns + g;
    return (float3)(columns[OFFSET_X * groups->stride], columns[OFFSET_Y * groups->stride],
                    columns[OFFSET_Z * groups->stride]);
}

// Bounds of distances to a layer.
void boundDistances(const Lanes* best2, float delta2, Lanes* bound) {
    UNROLLED for (int i = 0; i < SLICES; ++i) bound[i] = sqrt(max(best2[i] + delta2, (Lanes)(0.0f)));
}

// Applies the listed groups to a cube. Large ones are looked at once the others, and their own first runs, have been
// applied.
INLINED void applyGroups(const Input* input, const Voxels* v, const uint* list, uint count, Found* found) {
    const Groups* groups = &input->near.groups;
    const int k = input->layers.cube;
    const float delta2 = square(input->layers.delta);
    bool large = false;
    for (uint i = 0; i < count; ++i) {
        const uint g = list[i], begin = groups->begins[g], end = groups->begins[g + 1];
        const bool worthALook = end - begin >= RUNS_WORTH_A_LOOK;
        large = large || worthALook;
        for (uint r = begin; r < (worthALook ? begin + 1 : end); ++r)
            applyRun(found, v, input->samples, input->runs + r, k);
    }
    if (!large) return;
    Lanes inner[SLICES], outer[SLICES];
    boundDistances(found->inner2, delta2, inner);
    boundDistances(found->outer2, delta2, outer);
    for (uint i = 0; i < count; ++i) {
        const uint g = list[i], begin = groups->begins[g], end = groups->begins[g + 1];
        if (end - begin < RUNS_WORTH_A_LOOK) continue;
        const float3 place = placeOf(groups, g), offset = offsetOf(groups, g);
        const float radius = groups->columns[RADIUS * groups->stride + g];
        if (!mayImprove(v, place - offset, radius, delta2, inner, found->inner2) &&
            !mayImprove(v, place + offset, radius, delta2, outer, found->outer2))
            continue;
        for (uint r = begin + 1; r < end; ++r) applyRun(found, v, input->samples, input->runs + r, k);
    }
}

#if ITEMS > 1

// Whether a group reaches the row of this item.
bool reachesRow(const Input* input, uint g, float3 middle) {
    const Groups* groups = &input->near.groups;
    global const float* columns = groups->columns + g;
    const uint stride = groups->stride;
    const float slabReach = input->near.reach, ballReach = PAPER_CUBE ? slabReach : input->layers.certain,
                halfRow = 0.5f * (BLOCK_SIDE - 1);
    const float3 away = placeOf(groups, g) - middle, offset = PAPER_CUBE ? (float3)(0.0f) : offsetOf(groups, g),
                 normal = (float3)(columns[NORMAL_X * stride], columns[NORMAL_Y * stride], columns[NORMAL_Z * stride]);
    const float3 inner = away - offset, outer = away + offset;
    const float inner2 = square(inner.x) + square(inner.y) + square(max(fabs(inner.z) - halfRow, 0.0f)),
                outer2 = square(outer.x) + square(outer.y) + square(max(fabs(outer.z) - halfRow, 0.0f));
    return min(inner2, outer2) < square(columns[RADIUS * stride] + ballReach) &&
           fabs(dot(away, normal)) < columns[THICKNESS * stride] + slabReach + halfRow * fabs(normal.z);
}

// Applies all groups that reach the block to the row of this item.
void applyAll(const Input* input, SHARED uint* page, SHARED uint* count, Found* found) {
    const float3 first = input->near.inBrick + cornerOf(0);
    const Voxels voxels = voxelsOf(first);
    for (uint next = input->near.range.x; next < input->near.range.y;) {
        next = turnPage(&input->near, next, page, count);
        uint list[PAGE], listed = 0;
        for (uint i = 0; i < *count; ++i)
            if (reachesRow(input, page[i], first + (float3)(0, 0, 0.5f * (BLOCK_SIDE - 1)))) list[listed++] = page[i];
        applyGroups(input, &voxels, list, listed, found);
    }
}

#else

// Distance from the middle of a side to beyond its end, squared.
Lanes outsideOf(Lanes middle, float halfSide) {
    return squareLanes(max(fabs(middle) - halfSide, (Lanes)(0.0f)));
}

// A column of some groups.
Lanes columnOf(const Groups* groups, int column, const uint* which) {
    global const float* all = groups->columns + column * groups->stride;
    float some[LANES];
    for (int lane = 0; lane < LANES; ++lane) some[lane] = all[which[lane]];
    return vloadLanes(0, some);
}

// Which groups of a page reach each cube: the balls around their inner or outer samples must, and their slab. A vector
// of groups at a time, with what cubes have in common worked out once.
void listGroups(const Input* input, const uint* page, uint count, uint (*lists)[PAGE], uint* counts) {
    const Groups* groups = &input->near.groups;
    const float slabReach = input->near.reach, ballReach = PAPER_CUBE ? slabReach : input->layers.certain;
    const float halfCube = 0.5f * (SLICES - 1);
    const float inBrick[3] = {input->near.inBrick.x, input->near.inBrick.y, input->near.inBrick.z};
    for (int cube = 0; cube < CUBES; ++cube) counts[cube] = 0;
    for (uint i = 0; i < count; i += LANES) {
        const uint* which = page + i;
        const uint some = count - i < LANES ? (1u << (count - i)) - 1 : (1u << LANES) - 1;
        Lanes toInner2[3][2], toOuter2[3][2], height[3][2];
        Lanes slab = columnOf(groups, THICKNESS, which) + slabReach;
        for (int axis = 0; axis < 3; ++axis) {
            const Lanes place = columnOf(groups, PLACE_X + axis, which) - inBrick[axis],
                        offset = PAPER_CUBE ? (Lanes)(0.0f) : columnOf(groups, OFFSET_X + axis, which),
                        normal = columnOf(groups, NORMAL_X + axis, which);
            for (int side = 0; side < 2; ++side) {
                const float middle = (float)(side * SLICES) + halfCube;
                toInner2[axis][side] = outsideOf(middle - (place - offset), halfCube);
                toOuter2[axis][side] = outsideOf(middle - (place + offset), halfCube);
                height[axis][side] = (middle - place) * normal;
            }
            slab += halfCube * fabs(normal);
        }
        const Lanes reach2 = squareLanes(columnOf(groups, RADIUS, which) + ballReach);
        for (int cube = 0; cube < CUBES; ++cube) {
            const int a = cube / 4, b = cube / 2 % 2, c = cube % 2;
            const Lanes inner2 = toInner2[0][a] + toInner2[1][b] + toInner2[2][c],
                        outer2 = toOuter2[0][a] + toOuter2[1][b] + toOuter2[2][c];
            const IntLanes reaches =
                (min(inner2, outer2) < reach2) & (fabs(height[0][a] + height[1][b] + height[2][c]) < slab);
            uint listed = counts[cube];
            for (uint bits = bitsOf(reaches) & some; bits != 0; bits &= bits - 1)
                lists[cube][listed++] = which[lowestBit(bits)];
            counts[cube] = listed;
        }
    }
}

// Applies all groups that reach the block to its cubes.
void applyAll(const Input* input, SHARED uint* page, SHARED uint* count, Found* found) {
    uint lists[CUBES][PAGE], counts[CUBES];
    for (uint next = input->near.range.x; next < input->near.range.y;) {
        next = turnPage(&input->near, next, page, count);
        for (int lane = 0; lane < LANES; ++lane) page[*count + lane] = input->near.range.x;  // any group
        listGroups(input, page, *count, lists, counts);
        for (int cube = 0; cube < CUBES; ++cube) {
            if (counts[cube] == 0) continue;
            const Voxels voxels = voxelsOf(input->near.inBrick + cornerOf(cube));
            Found own = found[cube];  // in registers
            applyGroups(input, &voxels, lists[cube], counts[cube], &own);
            found[cube] = own;
        }
    }
}

#endif

// Eq. 3: from both layers to a slice's signed distances. The inside keeps its sign bit where the distance is clamped to
// zero.
Lanes combine(const Found* found, int slice, const Layers* layers, IntLanes* known) {
    const Lanes inner2 = found->inner2[slice], outer2 = found->outer2[slice];
    const float delta2 = square(layers->delta), certain2 = square(layers->certain) - delta2;
    const Lanes farther = sqrt(max(max(inner2, outer2) + delta2, (Lanes)(0.0f)));
    const Lanes clamped = max(farther - layers->delta, (Lanes)(0.0f));
    *known = min(inner2, outer2) < certain2;
    return select((Lanes)(INFINITY), select(clamped, -clamped, inner2 <= outer2 + LAYER_TIE), *known);
}

// Writes a slice of a cube into its block.
void putFloats(Lanes values, float3 at, global float* block) {
    global float* corner = block + (int)((at.x * BLOCK_SIDE + at.y) * BLOCK_SIDE + at.z);
#if ITEMS > 1
    vstore8(values, 0, corner);
#else
    vstore4(values.s0123, 0, corner);
    vstore4(values.s4567, 2, corner);
    vstore4(values.s89ab, 4, corner);
    vstore4(values.scdef, 6, corner);
#endif
}

enum { FILLED_BLOCKS };

// A group fills a block of a brick. Blocks that hold distances go to the next places of `origins`, `distances` and
// `nearestTriangles`.
GROUP_KERNEL void fillBlocks(Grid grid, global const uint* cellOfBrick, uint firstBrick, global const float* samples,
                             global const Run* runs, global float* groupColumns, global uint* groupBegins, uint stride,
                             global const uint2* ranges, Layers layers, global int* origins, global float* distances,
                             global int* nearestTriangles, global uint* counters) {
    SHARED uint page[PAGE + LANES], count, slot, anyKnown;
    const Groups groups = {groupColumns, groupBegins, stride};
    const Input input = {nearBlock(&grid, &groups, cellOfBrick, firstBrick, ranges), samples, runs, layers};
    if (input.near.range.x >= input.near.range.y) return;

    Found found[CUBES];
    const float farthest2 = square(layers.certain) - square(layers.delta);
    for (int cube = 0; cube < CUBES; ++cube)
        UNROLLED for (int i = 0; i < SLICES; ++i) {
            found[cube].inner2[i] = found[cube].outer2[i] = farthest2;
#if TRIANGLES
            found[cube].innerOwner[i] = found[cube].outerOwner[i] = -1;
#endif
        }
    applyAll(&input, page, &count, found);

    if (ITEM == 0) anyKnown = 0;
    MEET;
    uint known = 0;
    for (int cube = 0; cube < CUBES; ++cube)
        UNROLLED for (int i = 0; i < SLICES; ++i) {
            IntLanes knownLanes;
            combine(&found[cube], i, &layers, &knownLanes);
            known |= (uint)(anyLane(knownLanes));
        }
    if (known) anyKnown = 1;
    MEET;
    if (!anyKnown) return;
    if (ITEM == 0) {
        slot = atomic_inc(counters + FILLED_BLOCKS);
        vstore3(input.near.block, slot, origins);
    }
    MEET;
    for (int cube = 0; cube < CUBES; ++cube)
        UNROLLED for (int i = 0; i < SLICES; ++i) {
            const float3 at = cornerOf(cube) + (float3)((float)(i), 0, 0);
            IntLanes knownLanes;
            putFloats(combine(&found[cube], i, &layers, &knownLanes), at,
                      distances + (size_t)(slot)*BLOCK_VOXELS);
#if TRIANGLES
            const IntLanes inside = found[cube].inner2[i] <= found[cube].outer2[i] + LAYER_TIE;
#if LANES == 16
            putFloats(as_float16(select(found[cube].innerOwner[i], found[cube].outerOwner[i], inside)), at,
                      (global float*)(nearestTriangles) + (size_t)(slot)*BLOCK_VOXELS);
#else
            putFloats(as_float8(select(found[cube].innerOwner[i], found[cube].outerOwner[i], inside)), at,
                      (global float*)(nearestTriangles) + (size_t)(slot)*BLOCK_VOXELS);
#endif
#else
            (void)(nearestTriangles);
#endif
        }
}
