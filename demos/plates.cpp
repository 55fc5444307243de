#include "demos/scenes/plates.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    PlatesOptions options;
    Program program("plates", "Balls shot at thin plates stay in front of them");
    program.option("--speeds", options.speeds, "of balls [m/s]")->check(CLI::Range(0.1, 10000.0));
    program.option("--thicknesses", options.thicknesses, "of plates [voxels]")->check(CLI::Range(0.5, 10.0));
    program.option("--angles", options.angles, "between the way and the plate's normal [degrees]")
        ->check(CLI::Range(0, 60));
    program.option("--phases", options.phases, "balls that arrive in different parts of a step")
        ->check(CLI::Range(1, 64));
    program.option("--restitution", options.restitution, "of the impact")->check(CLI::Range(0.0, 1.0));
    program.option("--steps", options.stepsPerSecond, "a second")->check(CLI::Range(1.0, 10000.0));
    program.option("--voxel", options.voxelSize, "edge of a voxel [m]")->check(CLI::Range(0.001, 0.02));
    return program.run(argc, argv, [&] { return plates(options); });
}
