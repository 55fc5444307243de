#include "demos/scenes/pairs.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    PairsOptions options;
    Program program("pairs", "Every shape of Bullet's and a field, one on the other");
    program.option("--scale", options.scale, "of everything")->check(CLI::Range(0.005, 1000.0));
    program.option("--every", options.every, "only every so many pairs")->check(CLI::Range(1, 188));
    program.option("--only", options.only, "those with this in their name");
    program.option("--seconds", options.seconds, "how long [s]")->check(CLI::Range(0.5, 1000.0));
    program.option("--steps", options.stepsPerSecond, "a second")->check(CLI::Range(30.0, 10000.0));
    program.option("--iterations", options.iterations, "of Bullet's solver")->check(CLI::Range(1, 10000));
    return program.run(argc, argv, [&] { return pairs(options); });
}
