#include "demos/scenes/chain.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    ChainOptions options;
    Program program("chain", "A chain of rings carries a heavy one");
    program.option("--links", options.links, "rings, the fixed one included")->check(CLI::Range(2, 1000));
    program.option("--bob", options.bob, "mass of the last one [links]")->check(CLI::Range(0.1, 1000.0));
    program.option("--push", options.push, "speed of the last one at the start [m/s]")->check(CLI::Range(0.0, 100.0));
    program.option("--seconds", options.seconds, "how long [s]")->check(CLI::Range(0.1, 1000.0));
    program.option("--steps", options.stepsPerSecond, "a second")->check(CLI::Range(30.0, 10000.0));
    program.option("--iterations", options.iterations, "of Bullet's solver")->check(CLI::Range(1, 10000));
    program.option("--voxel", options.voxelSize, "edge of a voxel [m]")->check(CLI::Range(0.001, 0.02));
    return program.run(argc, argv, [&] { return chain(options); });
}
