#include "demos/scenes/gears.h"

#include <fmt/core.h>

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    GearsOptions options;
    Program program("gears", "A train of gears keeps its ratio");
    program.option("--teeth", options.teeth, "of each gear")->check(CLI::Range(18, 200))->expected(2, 100);
    program.option("--turns", options.turns, "of the first gear")->check(CLI::Range(0.1, 1000.0));
    program.option("--speed", options.speed, "of the first gear [rad/s]")->check(CLI::Range(0.1, 100.0));
    program.option("--load", options.load, "torque that brakes the last gear [N m]")->check(CLI::Range(0.0, 10.0));
    program.option("--backlash", options.backlash, "between the teeth [m]")->check(CLI::Range(0.0, 1e-3));
    program.option("--steps", options.stepsPerSecond, "a second")->check(CLI::Range(30.0, 10000.0));
    program.option("--iterations", options.iterations, "of Bullet's solver")->check(CLI::Range(1, 10000));
    program.option("--voxel", options.voxelSize, "edge of a voxel [m]")->check(CLI::Range(0.02e-3, 1e-3));
    program.option("--factory", options.factory,
                   "folder with the gear of the Factory data set, to play a pair of instead");
    return program.run(argc, argv, [&] {
        if (!options.factory.empty() && !hasFactoryGear(options.factory)) {
            fmt::print(stderr, "gears: no gear of Factory in {}: gears by formula instead\n", options.factory.string());
            options.factory.clear();
        }
        return gears(options);
    });
}
