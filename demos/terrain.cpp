#include "demos/scenes/terrain.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    TerrainOptions options;
    Program program("terrain", "Bodies slide over waves of triangles without friction and keep their speed");
    program.option("--height", options.height, "amplitude of the waves [m]")->check(CLI::Range(0.0, 0.1));
    program.option("--cell", options.cell, "edge of the ground's squares [m]")->check(CLI::Range(0.05, 2.5));
    program.flag("--height-field", options.heightField, "on a height field instead of a triangle mesh");
    program.option("--speed", options.speed, "at the start [m/s]")->check(CLI::Range(0.1, 4.0));
    program.option("--seconds", options.seconds, "how long [s]")->check(CLI::Range(0.5, 5.0));
    program.option("--steps", options.stepsPerSecond, "a second")->check(CLI::Range(30.0, 1000.0));
    program.option("--voxel", options.voxelSize, "edge of a voxel [m]")->check(CLI::Range(0.005, 0.02));
    return program.run(argc, argv, [&] { return terrain(options); });
}
