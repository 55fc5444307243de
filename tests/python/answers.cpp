// SPDX-License-Identifier: Apache-2.0
// usage: test_python_answers MESH VOXEL_SIZE POINTS ANSWERS
// The library's answers to the float32 points of a file, without Python: samples, closest points, rays from each point
// to zero, sphere casts of radius 0.1 along them, inside tests; contacts of the body with itself one voxel aside,
// distance of the body from itself, three units along x, and the times of impact and of penetration on the way back;
// volume and particles of the field. All are written as float32.
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <iterator>
#include <limits>
#include <span>
#include <vector>

#include <bilayer/collider/contact.h>
#include <bilayer/collider/distance.h>
#include <bilayer/collider/mass.h>
#include <bilayer/integration/fluid/particles.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>

using namespace bilayer;

namespace {

constexpr float infinite = std::numeric_limits<float>::infinity();

class FloatFile {
  public:
    explicit FloatFile(const char* path) : stream_(path, std::ios::binary) {}
    void add(float value) { stream_.write(reinterpret_cast<const char*>(&value), sizeof(value)); }
    void add(const glm::vec3& value) {
        for (int axis = 0; axis < 3; ++axis) add(value[axis]);
    }

  private:
    std::ofstream stream_;
};

std::vector<glm::vec3> readPoints(const char* path) {
    std::ifstream stream(path, std::ios::binary);
    const std::vector<char> bytes(std::istreambuf_iterator<char>(stream), {});
    std::vector<glm::vec3> points(bytes.size() / sizeof(glm::vec3));
    std::copy_n(bytes.data(), points.size() * sizeof(glm::vec3), reinterpret_cast<char*>(points.data()));
    return points;
}

void answer(const Mesh& mesh, float voxelSize, const std::vector<glm::vec3>& points, FloatFile& file) {
    const LevelSet levelSet = build(mesh, {.voxelSize = voxelSize});
    const Field field(levelSet, mesh);
    std::vector<Sample> samples(points.size());
    field.sample(points, samples);
    for (const Sample& sample : samples) file.add(sample.distance), file.add(sample.gradient);
    std::vector<ClosestPoint> closest(points.size());
    field.closest(points, closest);
    for (const ClosestPoint& point : closest)
        file.add(point.distance), file.add(point.position), file.add(point.normal);
    for (const glm::vec3& point : points) {
        const Ray ray{point, -point};
        const auto hit = field.raycast(ray), sphere = field.sphereCast(ray, 0.1f);
        file.add(hit ? hit->distance : infinite), file.add(sphere ? sphere->distance : infinite);
        file.add(hit && hit->triangle != noTriangle ? float(hit->triangle) : -1), file.add(field.inside(point));
    }
    const Collider collider(mesh, levelSet);
    std::vector<Contact> contacts;
    collide(collider, Pose{{voxelSize, 0, 0}}, collider, Pose{}, {.margin = voxelSize}, contacts);
    for (const Contact& contact : contacts)
        file.add(contact.position), file.add(contact.normal), file.add(contact.distance);
    file.add(distance({collider, {{3, 0, 0}}}, {collider, {}}).distance);
    const Placed thrown{collider, {{3, 0, 0}}, 1, {{-3, 0, 0}, {0, 0, 1}}}, ground{collider, {}};
    file.add(timeOfImpact(thrown, ground).fraction);
    file.add(timeOfImpact(thrown, ground, {.penetration = true}).fraction);
    file.add(float(massProperties(levelSet).volume));
    for (const glm::vec3& point : fluid::particles(*levelSet.grids().distance).positions) file.add(point);
}

}  // namespace

int main(int count, char** arguments) {
    if (count != 5) {
        std::cerr << "usage: test_python_answers MESH VOXEL_SIZE POINTS ANSWERS\n";
        return 2;
    }
    FloatFile file(arguments[4]);
    answer(readMesh(arguments[1]), float(std::atof(arguments[2])), readPoints(arguments[3]), file);
}
