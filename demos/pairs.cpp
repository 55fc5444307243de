// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/pairs.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    PairsOptions options;
    Program program("pairs", "Every shape of Bullet's and a field, one on the other");
    program.option("--scale", options.scale, "scale of all bodies")->check(CLI::Range(0.005, 1000.0));
    program.option("--every", options.every, "play only each N-th pair")->check(CLI::Range(1, 188));
    program.option("--only", options.only, "play only pairs whose name contains this");
    program.seconds(options.seconds, 0.5, 1000.0);
    program.steps(options.stepsPerSecond);
    program.iterations(options.iterations);
    return program.run(argc, argv, [&] { return pairs(options); });
}
