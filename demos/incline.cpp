// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/incline.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    InclineOptions options;
    Program program("incline", "Blocks on inclines stick and slide as friction says");
    program.option("--slopes", options.slopes, "angle of each incline [degrees]")->check(CLI::Range(1.0, 60.0));
    program.option("--frictions", options.frictions, "friction of each block, relative to the tangent of the slope")
        ->check(CLI::Range(0.0, 1000.0));
    program.seconds(options.seconds, 0.5, 60.0);
    program.voxel(options.voxelSize, 0.001, 0.05);
    return program.run(argc, argv, [&] { return incline(options); });
}
