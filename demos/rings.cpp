#include "demos/scenes/rings.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    RingsOptions options;
    Program program("rings", "A thousand rings fall down poles and come to rest");
    program.option("--rows", options.rows, "of poles; there are as many columns")->check(CLI::Range(1, 20));
    program.option("--rings", options.ringsPerPole, "on each pole")->check(CLI::Range(1, 200));
    program.option("--seconds", options.seconds, "most seconds to simulate")->check(CLI::Range(0.1, 1000.0));
    program.option("--steps", options.stepsPerSecond, "a second")->check(CLI::Range(30.0, 10000.0));
    program.option("--iterations", options.iterations, "of Bullet's solver")->check(CLI::Range(1, 10000));
    program.option("--voxel", options.voxelSize, "edge of a ring's voxels [m]")->check(CLI::Range(0.002, 0.02));
    program.option("--seed", options.seed, "of the rings' first poses");
    return program.run(argc, argv, [&] { return rings(options); });
}
