// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/bowl.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    BowlOptions options;
    std::vector<std::string> meshes;
    Program program("bowl", "Bodies fall into a bowl, colliding by their fields");
    program.option("--bodies", options.bodies, "count of bodies")->check(CLI::Range(1, 1000));
    program.option("--meshes", meshes, "files of closed meshes, y upward, used in turn; none: bunnies");
    program.seconds(options.seconds, 0.1, 1000.0, "maximum simulated time [s]");
    program.option("--hold", options.hold, "additional time with all bodies kept awake [s]")
        ->check(CLI::Range(0.0, 1000.0));
    program.option("--resolution", options.resolution, "voxels along a body")->check(CLI::Range(16, 1024));
    program.iterations(options.iterations);
    program.option("--seed", options.seed, "of the initial poses");
    return program.run(argc, argv, [&] {
        options.kinds.clear();
        for (const std::string& path : meshes) options.kinds.push_back(readKind(path));
        if (meshes.empty()) options.kinds.push_back(bunny());
        return bowl(options);
    });
}
