#include "demos/scenes/pegs.h"

#include <fmt/core.h>

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    PegsOptions options;
    Program program("pegs", "Pegs fall into holes that are hardly wider");
    program.option("--clearances", options.clearances, "of each peg [m]")->check(CLI::Range(0.005e-3, 2e-3));
    program.option("--friction", options.friction, "between peg and block")->check(CLI::Range(0.0, 2.0));
    program.option("--aside", options.aside, "of the hole's axis at the start [m]")->check(CLI::Range(0.0, 5e-3));
    program.option("--tilt", options.tilt, "at the start [degrees]")->check(CLI::Range(0.0, 10.0));
    program.option("--seconds", options.seconds, "how long [s]")->check(CLI::Range(0.1, 100.0));
    program.option("--steps", options.stepsPerSecond, "a second")->check(CLI::Range(30.0, 10000.0));
    program.option("--iterations", options.iterations, "of Bullet's solver")->check(CLI::Range(1, 10000));
    program.option("--voxel", options.voxelSize, "edge of a voxel [m]")->check(CLI::Range(0.02e-3, 1e-3));
    program.option("--factory", options.factory, "folder with peg and hole of the Factory data set, to play too");
    return program.run(argc, argv, [&] {
        if (!options.factory.empty() && !hasFactoryPeg(options.factory)) {
            fmt::print(stderr, "pegs: no peg and hole of Factory in {}: parts by formula alone\n",
                       options.factory.string());
            options.factory.clear();
        }
        return pegs(options);
    });
}
