// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/rings.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    RingsOptions options;
    Program program("rings", "A thousand rings fall down poles and come to rest");
    program.option("--rows", options.rows, "rows of poles; there are as many columns")->check(CLI::Range(1, 20));
    program.option("--rings", options.ringsPerPole, "rings on each pole")->check(CLI::Range(1, 200));
    program.seconds(options.seconds, 0.1, 1000.0, "maximum simulated time [s]");
    program.steps(options.stepsPerSecond);
    program.iterations(options.iterations);
    program.voxel(options.voxelSize, 0.002, 0.02);
    program.option("--seed", options.seed, "of the initial poses");
    return program.run(argc, argv, [&] { return rings(options); });
}
