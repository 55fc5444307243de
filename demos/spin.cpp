// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/spin.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    SpinOptions options;
    Program program("spin", "A free body spins about its middle axis, and keeps its angular momentum");
    program.seconds(options.seconds, 1.0, 3600.0);
    program.option("--spin", options.spin, "initial angular velocity about the middle axis [rad/s]")
        ->check(CLI::Range(0.1, 100.0));
    program.option("--perturbation", options.perturbation, "initial angular velocity about the other axes [rad/s]")
        ->check(CLI::Range(0.0, 10.0));
    program.voxel(options.voxelSize, 0.001, 0.02);
    return program.run(argc, argv, [&] { return spin(options); });
}
