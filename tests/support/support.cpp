// SPDX-License-Identifier: Apache-2.0
#include "tests/support/support.h"

#include <dlfcn.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <iostream>
#include <iterator>
#include <limits>

namespace bilayer::test {
namespace {

// A folder known at compile time, or that of an environment variable: tests may run on another machine.
std::filesystem::path folderOf(const char* variable, const char* atCompileTime) {
    const char* const elsewhere = std::getenv(variable);
    return elsewhere ? elsewhere : atCompileTime;
}

struct Scratch {
    std::filesystem::path folder = folderOf("BILAYER_SCRATCH", BILAYER_SCRATCH) / std::to_string(::getpid());
    Scratch() { std::filesystem::create_directories(folder); }
    ~Scratch() {
        std::error_code ignored;
        std::filesystem::remove_all(folder, ignored);
    }
};

double squaredDistanceToSegment(const glm::dvec3& point, const glm::dvec3& a, const glm::dvec3& b) {
    const glm::dvec3 edge = b - a;
    const double length2 = glm::dot(edge, edge);
    const double t = length2 > 0 ? std::clamp(glm::dot(point - a, edge) / length2, 0.0, 1.0) : 0.0;
    const glm::dvec3 gap = point - (a + t * edge);
    return glm::dot(gap, gap);
}

}  // namespace

std::optional<std::filesystem::path> corpusMesh(const std::string& name) {
    const std::filesystem::path path = folderOf("BILAYER_MESHES", BILAYER_MESHES) / name;
    if (std::filesystem::exists(path)) return path;
    std::cerr << "skipped: the corpus mesh " << name << " is not here\n";
    return std::nullopt;
}

std::filesystem::path scratch(const std::string& name) {
    static const Scratch once;
    return once.folder / name;
}

std::string contentsOf(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

bool isSanitized() {
    return ::dlsym(RTLD_DEFAULT, "__sanitizer_get_allocated_size");
}

unsigned seed() {
    if (const char* given = std::getenv("BILAYER_SEED")) return unsigned(std::strtoul(given, nullptr, 10));
    return unsigned(std::chrono::system_clock::now().time_since_epoch().count());
}

double squaredDistance(const glm::dvec3& point, const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
    // inside the triangle's prism the plane is nearest, elsewhere one of the three edges is; the normal of a sliver is
    // rounding, and its edges are the better answer
    const glm::dvec3 normal = glm::cross(b - a, c - a);
    const double area2 = glm::dot(normal, normal);
    double ofPlane = std::numeric_limits<double>::infinity();
    if (area2 > 0) {
        const bool ab = glm::dot(glm::cross(b - a, point - a), normal) >= 0;
        const bool bc = glm::dot(glm::cross(c - b, point - b), normal) >= 0;
        const bool ca = glm::dot(glm::cross(a - c, point - c), normal) >= 0;
        if (ab && bc && ca) {
            const double height = glm::dot(point - a, normal);
            ofPlane = height * height / area2;
        }
    }
    return std::min({ofPlane, squaredDistanceToSegment(point, a, b), squaredDistanceToSegment(point, b, c),
                     squaredDistanceToSegment(point, c, a)});
}

double distance(const Mesh& mesh, const glm::dvec3& point) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const auto& t : mesh.triangles)
        nearest = std::min(nearest, squaredDistance(point, mesh.points[t.x], mesh.points[t.y], mesh.points[t.z]));
    return std::sqrt(nearest);
}

double windingNumber(const Mesh& mesh, const glm::dvec3& point) {
    // solid angles: A. Van Oosterom, J. Strackee, "The Solid Angle of a Plane Triangle", 1983
    double angle = 0;
    for (const auto& t : mesh.triangles) {
        const glm::dvec3 a = glm::dvec3(mesh.points[t.x]) - point, b = glm::dvec3(mesh.points[t.y]) - point,
                         c = glm::dvec3(mesh.points[t.z]) - point;
        const double la = glm::length(a), lb = glm::length(b), lc = glm::length(c);
        const double below = la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb;
        angle += 2 * std::atan2(glm::dot(a, glm::cross(b, c)), below);
    }
    return angle / (4 * glm::pi<double>());
}

double signedDistance(const Mesh& mesh, const glm::dvec3& point) {
    return windingNumber(mesh, point) > 0.5 ? -distance(mesh, point) : distance(mesh, point);
}

}  // namespace bilayer::test
