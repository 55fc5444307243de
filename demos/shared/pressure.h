// The pressure that keeps a liquid's volume: OpenVDB's conjugate gradients, with faces that a solid body closes in part
// and a free surface that lies between the cells.
#pragma once

#include <openvdb/openvdb.h>

#include <memory>

#include "demos/shared/basin.h"
#include "demos/shared/face_velocity.h"

namespace bilayer::demo {

struct Projection {
    int cells = 0;       ///< of liquid
    int iterations = 0;  ///< of the conjugate gradients
    double divergence =
        0;  ///< what remains in the worst cell, but for what liquid without a surface cannot let out [1/s]
    bool converged = true;
};

class Pressure {
  public:
    /// Makes a velocity free of divergence in all cells of a level set's inside. Faces are as open as the basin says
    /// and the body moves at its own speed across the rest of them (C. Batty, F. Bertails, R. Bridson, "A fast
    /// variational framework for accurate solid-fluid coupling", 2007); the pressure is nothing where the level set is
    /// 0 between two cells (F. Gibou, R. Fedkiw, L.-T. Cheng, M. Kang, "A second-order-accurate symmetric
    /// discretization of the Poisson equation on irregular domains", 2002). Afterwards the faces of liquid cells are
    /// known, others are not.
    /// @param velocity  all faces of liquid cells are known, those behind walls too
    /// @param growth    the divergence asked for [1/s]
    Projection project(FaceVelocity& velocity, const openvdb::FloatGrid& liquid, const Basin& basin, double growth = 0);

  private:
    openvdb::DoubleTree::Ptr last_ = std::make_shared<openvdb::DoubleTree>(0.0);  // where the next solution starts from
};

}  // namespace bilayer::demo
