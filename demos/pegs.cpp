// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/pegs.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    PegsOptions options;
    Program program("pegs", "Pegs fall into holes that are hardly wider");
    program.option("--clearances", options.clearances, "diametral clearance of each peg [m]")
        ->check(CLI::Range(0.005e-3, 2e-3));
    program.option("--friction", options.friction, "friction between peg and block")->check(CLI::Range(0.0, 2.0));
    program.option("--offset", options.offset, "initial offset from the hole's axis [m]")->check(CLI::Range(0.0, 5e-3));
    program.option("--tilt", options.tilt, "initial tilt [degrees]")->check(CLI::Range(0.0, 10.0));
    program.seconds(options.seconds, 0.1, 100.0);
    program.steps(options.stepsPerSecond);
    program.iterations(options.iterations);
    program.voxel(options.voxelSize, 0.02e-3, 1e-3);
    program.factory(options.factory, "peg and hole", "which are added", hasFactoryPeg);
    return program.run(argc, argv, [&] { return pegs(options); });
}
