// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/enright.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    EnrightOptions options;
    Program program("enright", "A sphere and a bunny in Enright's deformation flow");
    program.option("--resolution", options.resolution, "voxels along the unit cube")->check(CLI::Range(16, 1000));
    program.option("--frames", options.framesPerSecond, "frames per second of the recording")
        ->check(CLI::Range(1, 100));
    return program.run(argc, argv, [&] { return enright(options); });
}
