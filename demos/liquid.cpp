// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/liquid.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    LiquidOptions options;
    Program program("liquid", "A liquid bunny falls into a tank, around a solid knot");
    program.option("--resolution", options.resolution, "cells along the tank's longest side")
        ->check(CLI::Range(16, 400));
    program.seconds(options.seconds, 0.05, 100.0);
    program.option("--turns", options.turns, "revolutions of the knot per second")->check(CLI::Range(-10.0, 10.0));
    program.option("--restoring", options.restoring, "time in which lost volume is restored [s]; 0: never")
        ->check(CLI::Range(0.0, 100.0));
    program.option("--frames", options.framesPerSecond, "frames per second of the recording")
        ->check(CLI::Range(1, 100));
    return program.run(argc, argv, [&] { return liquid(options); });
}
