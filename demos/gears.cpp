// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/gears.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    GearsOptions options;
    Program program("gears", "A train of gears keeps its ratio");
    program.option("--teeth", options.teeth, "count of teeth of each gear")
        ->check(CLI::Range(18, 200))
        ->expected(2, 100);
    program.option("--turns", options.turns, "revolutions of the first gear")->check(CLI::Range(0.1, 1000.0));
    program.option("--speed", options.speed, "angular velocity of the first gear [rad/s]")
        ->check(CLI::Range(0.1, 100.0));
    program.option("--load", options.load, "torque that brakes the last gear [N m]")->check(CLI::Range(0.0, 10.0));
    program.option("--backlash", options.backlash, "circumferential backlash [m]")->check(CLI::Range(0.0, 1e-3));
    program.steps(options.stepsPerSecond);
    program.iterations(options.iterations);
    program.voxel(options.voxelSize, 0.02e-3, 1e-3);
    program.factory(options.factory, "the gear", "a pair of which replaces the gears", hasFactoryGear);
    return program.run(argc, argv, [&] { return gears(options); });
}
