// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/plates.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    PlatesOptions options;
    Program program("plates", "Balls shot at thin plates stay in front of them");
    program.option("--speeds", options.speeds, "speeds of the balls [m/s]")->check(CLI::Range(0.1, 10000.0));
    program.option("--thicknesses", options.thicknesses, "thicknesses of the plates [voxels]")
        ->check(CLI::Range(0.5, 10.0));
    program.option("--angles", options.angles, "angles between the path and the plate's normal [degrees]")
        ->check(CLI::Range(0, 60));
    program.option("--phases", options.phases, "count of balls that arrive at different times within a step")
        ->check(CLI::Range(1, 64));
    program.option("--restitution", options.restitution, "coefficient of restitution")->check(CLI::Range(0.0, 1.0));
    program.steps(options.stepsPerSecond, 1.0, 10000.0);
    program.voxel(options.voxelSize, 0.001, 0.02);
    return program.run(argc, argv, [&] { return plates(options); });
}
