// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/terrain.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    TerrainOptions options;
    Program program("terrain", "Bodies slide without friction or roll over waves of triangles and keep their speed");
    program.option("--height", options.height, "amplitude of the waves [m]")->check(CLI::Range(0.0, 0.1));
    program.option("--cell", options.cell, "edge of the ground's squares [m]")->check(CLI::Range(0.05, 2.5));
    program.flag("--height-field", options.heightField, "use a height field instead of a triangle mesh");
    program.flag("--roll", options.rolls, "only a ball and a capsule, which roll with friction");
    bool isFaceted = false;
    program.flag("--no-smooth-ground", isFaceted, "do not give back the speed that edges of the ground take");
    program.option("--speed", options.speed, "initial speed [m/s]")->check(CLI::Range(0.1, 4.0));
    program.seconds(options.seconds, 0.5, 5.0);
    program.steps(options.stepsPerSecond, 30.0, 1000.0);
    program.voxel(options.voxelSize, 0.005, 0.02);
    return program.run(argc, argv, [&] {
        options.smoothGround = !isFaceted;
        return terrain(options);
    });
}
