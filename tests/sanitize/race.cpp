// SPDX-License-Identifier: Apache-2.0
// A race, for the test of the thread sanitizer's suppressions: two threads write one number while they query a field.
#include <thread>

#include <bilayer/collider/field.h>
#include <bilayer/sdf/build.h>

namespace {

int raced = 0;

[[gnu::noinline]] void raceInOurCode(const bilayer::Field& field) {
    for (int i = 0; i < 1000; ++i) raced += field.inside({0.1f, 0.1f, float(i)});
}

}  // namespace

int main() {
    const bilayer::Mesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                             {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
    const bilayer::Field field(bilayer::build(mesh, {.voxelSize = 0.1f}), mesh);
    std::thread other([&] { raceInOurCode(field); });
    raceInOurCode(field);
    other.join();
    return raced == 0;
}
