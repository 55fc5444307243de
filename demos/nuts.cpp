// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/nuts.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    NutsOptions options;
    Program program("nuts", "Nuts run down their bolts, or are held by friction");
    program.option("--pairs", options.pairs, "count of bolts with nuts")->check(CLI::Range(1, 1000));
    program.option("--frictions", options.frictions, "friction coefficients, used in turn")
        ->check(CLI::Range(0.0, 1000.0));
    program.option("--turns", options.turns, "revolutions of the nuts")->check(CLI::Range(1.0, 15.0));
    program.seconds(options.seconds, 0.2, 1000.0, "maximum simulated time [s]");
    program.option("--clearance", options.clearance, "clearance of the threads [m]")->check(CLI::Range(0.0, 0.15e-3));
    program.option("--weights", options.weights, "gravity on the nuts, in multiples of their weight")
        ->check(CLI::Range(0.1, 20.0));
    program.option("--segments", options.segments, "edges per circle of the threads, a multiple of 24")
        ->check(CLI::Range(24, 1536));
    program.steps(options.stepsPerSecond);
    program.iterations(options.iterations);
    program.voxel(options.voxelSize, 0.02e-3, 1e-3);
    program.factory(options.factory, "bolt and nut", "which replace the parts", hasFactoryThread);
    return program.run(argc, argv, [&] { return nuts(options); });
}
