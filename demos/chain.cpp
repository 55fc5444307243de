// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/chain.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    ChainOptions options;
    Program program("chain", "A chain of rings carries a heavy one");
    program.option("--links", options.links, "rings, the fixed one included")->check(CLI::Range(2, 1000));
    program.option("--bob", options.bob, "mass of the last ring, relative to a link's")->check(CLI::Range(0.1, 1000.0));
    program.option("--push", options.push, "initial speed of the last ring [m/s]")->check(CLI::Range(0.0, 100.0));
    program.seconds(options.seconds, 0.1, 1000.0);
    program.steps(options.stepsPerSecond);
    program.iterations(options.iterations);
    program.voxel(options.voxelSize, 0.001, 0.02);
    return program.run(argc, argv, [&] { return chain(options); });
}
