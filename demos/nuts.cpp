#include "demos/scenes/nuts.h"

#include <fmt/core.h>

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    NutsOptions options;
    Program program("nuts", "Nuts run down their bolts, or are held by friction");
    program.option("--pairs", options.pairs, "of bolt and nut")->check(CLI::Range(1, 1000));
    program.option("--frictions", options.frictions, "of the pairs in turn")->check(CLI::Range(0.0, 1000.0));
    program.option("--turns", options.turns, "that nuts make")->check(CLI::Range(1.0, 15.0));
    program.option("--seconds", options.seconds, "most seconds to simulate")->check(CLI::Range(0.2, 1000.0));
    program.option("--clearance", options.clearance, "of the threads [m]")->check(CLI::Range(0.0, 0.15e-3));
    program.option("--weights", options.weights, "gravity on the nuts, in multiples of their weight")
        ->check(CLI::Range(0.1, 20.0));
    program.option("--segments", options.segments, "of the threads, a multiple of 24")->check(CLI::Range(24, 1536));
    program.option("--steps", options.stepsPerSecond, "a second")->check(CLI::Range(30.0, 10000.0));
    program.option("--iterations", options.iterations, "of Bullet's solver")->check(CLI::Range(1, 10000));
    program.option("--voxel", options.voxelSize, "edge of a voxel [m]")->check(CLI::Range(0.02e-3, 1e-3));
    program.option("--factory", options.factory, "folder with bolt and nut of the Factory data set, to play instead");
    return program.run(argc, argv, [&] {
        if (!options.factory.empty() && !hasFactoryThread(options.factory)) {
            fmt::print(stderr, "nuts: no bolt and nut of Factory in {}: parts by formula instead\n",
                       options.factory.string());
            options.factory.clear();
        }
        return nuts(options);
    });
}
