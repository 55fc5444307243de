#include "demos/scenes/bowl.h"

#include "demos/shared/program.h"

int main(int argc, char** argv) {
    using namespace bilayer::demo;
    BowlOptions options;
    std::vector<std::string> meshes;
    Program program("bowl", "Bodies fall into a bowl, colliding by their fields");
    program.option("--bodies", options.bodies, "how many")->check(CLI::Range(1, 1000));
    program.option("--meshes", meshes, "files of closed meshes, y upward, that bodies are of in turn; none: bunnies");
    program.option("--seconds", options.seconds, "most seconds to simulate")->check(CLI::Range(0.1, 1000.0));
    program.option("--hold", options.hold, "seconds to go on with all kept awake")->check(CLI::Range(0.0, 1000.0));
    program.option("--resolution", options.resolution, "voxels along a body")->check(CLI::Range(16, 1024));
    program.option("--iterations", options.iterations, "of Bullet's solver")->check(CLI::Range(1, 10000));
    program.option("--seed", options.seed, "of the first poses");
    return program.run(argc, argv, [&] {
        options.kinds.clear();
        for (const std::string& path : meshes) options.kinds.push_back(readKind(path));
        if (meshes.empty()) options.kinds.push_back(bunny());
        return bowl(options);
    });
}
