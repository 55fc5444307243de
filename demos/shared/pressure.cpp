// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/pressure.h"

#include <openvdb/tools/LevelSetUtil.h>
#include <openvdb/tools/Morphology.h>
#include <openvdb/tools/PoissonSolver.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "sdf/base/openvdb.h"

namespace bilayer::demo {
namespace {

namespace pcg = openvdb::math::pcg;
namespace poisson = openvdb::tools::poisson;
using openvdb::BoolTree;
using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using openvdb::Int32Tree;
using openvdb::Vec3SGrid;
using Vector = pcg::Vector<double>;
using Matrix = poisson::LaplacianMatrix;

constexpr double minDistance = 0.02;  // of the surface from a cell centre, where it is a divisor [voxels]
constexpr double tolerance = 1e-5;    // relative to the max divergence
constexpr int maxIterations = 1000;
constexpr double towardsZero = 1e-6;  // strength with which pressures are pulled to zero if no surface determines them

// The data that the equations of a cell read; one reader per thread.
struct Reader {
    Reader(const FaceVelocity& velocity, const FloatGrid& liquid, const Basin& basin, const Int32Tree& cells)
        : speed{velocity.axes[0]->getConstAccessor(), velocity.axes[1]->getConstAccessor(),
                velocity.axes[2]->getConstAccessor()},
          liquid(liquid.getConstAccessor()),
          open(basin.open().getConstAccessor()),
          body(basin.bodyVelocity().getConstAccessor()),
          cells(cells) {}

    std::array<FloatGrid::ConstAccessor, 3> speed;
    FloatGrid::ConstAccessor liquid;
    Vec3SGrid::ConstAccessor open, body;
    openvdb::tree::ValueAccessor<const Int32Tree> cells;

    // Returns the outflow through the upper faces of a cell minus the inflow through the lower ones [m/s].
    double outflow(const Coord& cell) const {
        double sum = 0;
        for (int axis = 0; axis < 3; ++axis)
            for (const int side : {0, 1}) {
                Coord face = cell;
                face[axis] += side;
                const double part = open.getValue(face)[axis];
                const double across =
                    part * speed[std::size_t(axis)].getValue(face) + (1 - part) * double(body.getValue(face)[axis]);
                sum += side ? across : -across;
            }
        return sum;
    }

    // Returns the distance from a liquid cell's centre to the surface, towards a neighbour that is not liquid [voxels].
    double surfaceBetween(const Coord& cell, const Coord& neighbour) const {
        const double here = liquid.getValue(cell), there = liquid.getValue(neighbour);
        return there > 0 ? std::max(here / (here - there), minDistance) : 1;
    }
};

// Returns the numbered cells whose centres are in the liquid and that have an open face.
Int32Tree::Ptr cellsOf(const FloatGrid& liquid, const Basin& basin) {
    const auto mask = openvdb::tools::sdfInteriorMask(liquid);
    mask->tree().clip(basin.box());
    mask->tree().voxelizeActiveTiles();
    openvdb::tree::LeafManager<BoolTree> leaves(mask->tree());
    leaves.foreach ([&](BoolTree::LeafNodeType& leaf, std::size_t) {
        const auto open = basin.open().getConstAccessor();
        for (auto cell = leaf.beginValueOn(); cell; ++cell) {
            const Coord at = cell.getCoord();
            float most = openvdb::math::Max(open.getValue(at)[0], open.getValue(at)[1], open.getValue(at)[2]);
            for (int axis = 0; axis < 3; ++axis) {
                Coord next = at;
                next[axis] += 1;
                most = std::max(most, open.getValue(next)[axis]);
            }
            if (!(most > 0)) cell.setValueOff();
        }
    });
    return poisson::createIndexTree(mask->tree());
}

// Returns whether one of the cell's own faces leads to the surface.
bool fillRow(const Reader& read, const Coord& cell, int index, Matrix& matrix) {
    Matrix::RowEditor row = matrix.getRowEditor(pcg::SizeType(index));
    double diagonal = 0;
    bool atSurface = false;
    for (int axis = 0; axis < 3; ++axis)
        for (const int side : {0, 1}) {
            Coord face = cell, neighbour = cell;
            face[axis] += side;
            neighbour[axis] += 2 * side - 1;
            const double part = read.open.getValue(face)[axis];
            if (!(part > 0)) continue;
            int column;
            if (read.cells.probeValue(neighbour, column)) {
                row.setValue(pcg::SizeType(column), -part);
                diagonal += part;
            } else {
                diagonal += part / read.surfaceBetween(cell, neighbour);
                atSurface = true;
            }
        }
    row.setValue(pcg::SizeType(index), diagonal);
    return atSurface;
}

// The linear system: how the pressures of cells affect their outflow.
struct System {
    explicit System(pcg::SizeType cells) : matrix(cells), outflow(cells), wanted(cells), atSurface(cells) {}

    Matrix matrix;
    Vector outflow, wanted;       // current and target outflow [m/s]
    std::vector<char> atSurface;  // for each cell, whether one of its own faces leads to the surface
};

// Handles enclosed liquid without a surface. It cannot expand, and its pressures are determined only up to a constant.
// Its cells share the divergence that they cannot release, and their pressures are pulled slightly to zero.
void closePockets(System& system) {
    const auto count = system.matrix.numRows();
    std::vector<pcg::SizeType> parent(count), cells(count);
    std::iota(parent.begin(), parent.end(), 0);
    const auto pocketOf = [&](pcg::SizeType cell) {
        while (parent[cell] != cell) cell = parent[cell] = parent[parent[cell]];
        return cell;
    };
    for (pcg::SizeType cell = 0; cell < count; ++cell)
        for (auto value = system.matrix.getConstRow(cell).cbegin(); value; ++value)
            parent[pocketOf(value.column())] = pocketOf(cell);

    std::vector<char> open(count);
    std::vector<double> outflow(count);
    for (pcg::SizeType cell = 0; cell < count; ++cell) {
        const pcg::SizeType pocket = pocketOf(cell);
        open[pocket] |= system.atSurface[cell];
        outflow[pocket] += system.outflow[cell];
        ++cells[pocket];
    }
    for (pcg::SizeType cell = 0; cell < count; ++cell) {
        const pcg::SizeType pocket = pocketOf(cell);
        if (open[pocket]) continue;
        system.wanted[cell] = outflow[pocket] / double(cells[pocket]);
        const double diagonal = system.matrix.getConstRow(cell).getValue(cell);
        system.matrix.getRowEditor(cell).setValue(cell, (1 + towardsZero) * diagonal);
    }
}

// OpenVDB stops when the residual has doubled since its min, which may happen temporarily with conjugate gradients. The
// solver then restarts from there.
pcg::State solve(const Matrix& matrix, const Vector& change, Vector& pressure) {
    pcg::IncompleteCholeskyPreconditioner<Matrix> preconditioner(matrix);
    pcg::State limits = pcg::terminationDefaults<double>(), state;
    limits.relativeError = tolerance;
    int iterations = 0;
    do {
        limits.iterations = maxIterations - iterations;
        state = pcg::solve(matrix, change, pressure, preconditioner, std::as_const(limits));
        iterations += state.iterations;
    } while (!state.success && iterations < maxIterations);
    state.iterations = iterations;
    return state;
}

// Accelerates the faces of the liquid's cells by the pressure difference across them.
void accelerate(FaceVelocity& velocity, const FloatGrid& liquid, const Basin& basin, const Int32Tree& cells,
                const Vector& pressure) {
    const FaceVelocity before = velocity;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto tree = std::make_shared<FloatTree>(cells, 0.f, openvdb::TopologyCopy());
        openvdb::tools::dilateActiveValues(*tree, 1, openvdb::tools::NN_FACE, openvdb::tools::IGNORE_TILES);
        openvdb::tree::LeafManager<FloatTree> leaves(*tree);
        leaves.foreach ([&](FloatTree::LeafNodeType& leaf, std::size_t) {
            const Reader read(before, liquid, basin, cells);
            for (auto face = leaf.beginValueOn(); face; ++face) {
                const Coord upper = face.getCoord();
                Coord lower = upper;
                lower[int(axis)] -= 1;
                int low = -1, high = -1;
                const bool wetLow = read.cells.probeValue(lower, low), wetHigh = read.cells.probeValue(upper, high);
                if ((!wetLow && !wetHigh) || !(read.open.getValue(upper)[axis] > 0)) {
                    face.setValueOff();
                    continue;
                }
                const double rise =
                    (wetHigh ? pressure[pcg::SizeType(high)] : 0) - (wetLow ? pressure[pcg::SizeType(low)] : 0);
                const double length = wetLow && wetHigh ? 1
                                      : wetLow          ? read.surfaceBetween(lower, upper)
                                                        : read.surfaceBetween(upper, lower);
                face.setValue(float(read.speed[axis].getValue(upper) - rise / length));
            }
        });
        velocity.axes[axis] = before.axes[axis]->copyWithNewTree();
        velocity.axes[axis]->setTree(tree);
    }
}

double worstOutflow(const FaceVelocity& velocity, const FloatGrid& liquid, const Basin& basin, const Int32Tree& cells,
                    const Vector& wanted) {
    const Reader read(velocity, liquid, basin, cells);
    double worst = 0;
    for (auto cell = cells.cbeginValueOn(); cell; ++cell)
        worst = std::max(worst, std::abs(read.outflow(cell.getCoord()) - wanted[pcg::SizeType(*cell)]));
    return worst;
}

}  // namespace

Projection Pressure::project(FaceVelocity& velocity, const FloatGrid& liquid, const Basin& basin, double growth) {
    const Int32Tree::Ptr cells = cellsOf(liquid, basin);
    const auto count = pcg::SizeType(cells->activeVoxelCount());
    const double voxel = liquid.voxelSize()[0];
    if (count == 0) return {};

    // pressures are scaled: their differences are changes of velocity [m/s]
    System system(count);
    openvdb::tree::LeafManager<const Int32Tree> leaves(*cells);
    leaves.foreach ([&](const Int32Tree::LeafNodeType& leaf, std::size_t) {
        const Reader read(velocity, liquid, basin, *cells);
        for (auto cell = leaf.cbeginValueOn(); cell; ++cell) {
            const auto index = pcg::SizeType(*cell);
            system.atSurface[index] = fillRow(read, cell.getCoord(), *cell, system.matrix);
            system.outflow[index] = read.outflow(cell.getCoord());
            system.wanted[index] = growth * voxel;
        }
    });
    closePockets(system);
    Vector change(count);
    for (pcg::SizeType i = 0; i < count; ++i) change[i] = system.wanted[i] - system.outflow[i];

    const Vector::Ptr pressure = poisson::createVectorFromTree<double>(*last_, *cells);
    const pcg::State state = solve(system.matrix, change, *pressure);
    last_ = poisson::createTreeFromVector<double>(*pressure, *cells, 0.0);

    accelerate(velocity, liquid, basin, *cells, *pressure);
    return {int(count), state.iterations, worstOutflow(velocity, liquid, basin, *cells, system.wanted) / voxel,
            state.success};
}

}  // namespace bilayer::demo
