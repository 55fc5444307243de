#include "demos/shared/pressure.h"

#include <openvdb/tools/LevelSetUtil.h>
#include <openvdb/tools/Morphology.h>
#include <openvdb/tools/PoissonSolver.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

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

constexpr double leastDistance = 0.02;  // of the surface from a liquid cell's centre, where it divides [voxels]
constexpr double tolerance = 1e-5;      // of the divergence, in parts of its largest
constexpr int mostIterations = 1000;

// All that the equations of a cell read; one for each thread.
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

    // What leaves through the upper faces of a cell and enters through the lower ones [m/s].
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

    // How far from a liquid cell's centre the surface is, on the way to a neighbour that is none [voxels].
    double surfaceBetween(const Coord& cell, const Coord& neighbour) const {
        const double here = liquid.getValue(cell), there = liquid.getValue(neighbour);
        return there > 0 ? std::max(here / (here - there), leastDistance) : 1;
    }
};

// The cells whose centres are in the liquid and that are not closed all around, numbered.
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

void fillRow(const Reader& read, const Coord& cell, int index, Matrix& matrix) {
    Matrix::RowEditor row = matrix.getRowEditor(pcg::SizeType(index));
    double diagonal = 0;
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
            }
        }
    row.setValue(pcg::SizeType(index), diagonal);
}

// The faces of the liquid's cells, sped up by the difference of the pressures at either side.
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
                    double wanted) {
    const Reader read(velocity, liquid, basin, cells);
    double worst = 0;
    for (auto cell = cells.cbeginValueOn(); cell; ++cell)
        worst = std::max(worst, std::abs(read.outflow(cell.getCoord()) - wanted));
    return worst;
}

}  // namespace

Projection Pressure::project(FaceVelocity& velocity, const FloatGrid& liquid, const Basin& basin, double growth) {
    const Int32Tree::Ptr cells = cellsOf(liquid, basin);
    const auto count = pcg::SizeType(cells->activeVoxelCount());
    const double voxel = liquid.voxelSize()[0];
    if (count == 0) return {};

    // pressures are scaled: their differences are changes of speed [m/s]
    Matrix matrix(count);
    Vector outflow(count);
    openvdb::tree::LeafManager<const Int32Tree> leaves(*cells);
    leaves.foreach ([&](const Int32Tree::LeafNodeType& leaf, std::size_t) {
        const Reader read(velocity, liquid, basin, *cells);
        for (auto cell = leaf.cbeginValueOn(); cell; ++cell) {
            fillRow(read, cell.getCoord(), *cell, matrix);
            outflow[pcg::SizeType(*cell)] = growth * voxel - read.outflow(cell.getCoord());
        }
    });

    pcg::State limits = pcg::terminationDefaults<double>();
    limits.iterations = mostIterations;
    limits.relativeError = tolerance;
    pcg::IncompleteCholeskyPreconditioner<Matrix> preconditioner(matrix);
    const Vector::Ptr pressure = poisson::createVectorFromTree<double>(*last_, *cells);
    const pcg::State state = pcg::solve(matrix, outflow, *pressure, preconditioner, std::as_const(limits));
    last_ = poisson::createTreeFromVector<double>(*pressure, *cells, 0.0);

    accelerate(velocity, liquid, basin, *cells, *pressure);
    return {int(count), state.iterations, worstOutflow(velocity, liquid, basin, *cells, growth * voxel) / voxel,
            state.success};
}

}  // namespace bilayer::demo
