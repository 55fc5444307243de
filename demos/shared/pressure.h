// SPDX-License-Identifier: Apache-2.0
// The pressure projection that preserves a liquid's volume: OpenVDB's conjugate gradients, with faces that a solid body
// partly closes and a free surface between cell centres.
#pragma once

#include <openvdb/openvdb.h>

#include <memory>

#include "demos/shared/basin.h"
#include "demos/shared/face_velocity.h"

namespace bilayer::demo {

struct Projection {
    int cells = 0;          ///< liquid cells
    int iterations = 0;     ///< iterations of the conjugate gradients
    double divergence = 0;  ///< max residual, except for what liquid without a surface cannot release [1/s]
    bool converged = true;
};

class Pressure {
  public:
    /// Makes a velocity divergence-free in all cells inside a level set. The basin gives the open fraction of each
    /// face. Across the rest of the face, liquid moves at the body's speed (C. Batty, F. Bertails, R. Bridson, "A fast
    /// variational framework for accurate solid-fluid coupling", 2007). The pressure is zero where the level set
    /// crosses 0 between two cells (F. Gibou, R. Fedkiw, L.-T. Cheng, M. Kang, "A second-order-accurate symmetric
    /// discretization of the Poisson equation on irregular domains", 2002). Afterwards exactly the faces of liquid
    /// cells are known.
    /// @param velocity  all faces of liquid cells must be known, including those behind walls
    /// @param growth    the target divergence [1/s]
    Projection project(FaceVelocity& velocity, const openvdb::FloatGrid& liquid, const Basin& basin, double growth = 0);

  private:
    openvdb::DoubleTree::Ptr last_ = std::make_shared<openvdb::DoubleTree>(0.0);  // initial guess of the next solve
};

}  // namespace bilayer::demo
