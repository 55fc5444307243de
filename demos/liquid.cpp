#include "demos/scenes/liquid.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    LiquidOptions options;
    Program program("liquid", "A liquid bunny falls into a tank, around a solid knot");
    program.option("--resolution", options.resolution, "cells along the tank's longest side")
        ->check(CLI::Range(16, 400));
    program.option("--seconds", options.seconds, "how long [s]")->check(CLI::Range(0.05, 100.0));
    program.option("--turns", options.turns, "of the knot, a second")->check(CLI::Range(-10.0, 10.0));
    program.option("--restoring", options.restoring, "time in which lost volume comes back [s]; 0: never")
        ->check(CLI::Range(0.0, 100.0));
    program.option("--frames", options.framesPerSecond, "of the recording, a second")->check(CLI::Range(1, 100));
    return program.run(argc, argv, [&] { return liquid(options); });
}
