// SPDX-License-Identifier: Apache-2.0
#include "bench/builders.h"

#include <fmt/format.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/task_arena.h>
#include <openvdb/tools/MeshToVolume.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <stdexcept>

#include <bilayer/cl/filler.h>
#include <bilayer/sdf/build.h>
#include <bilayer/sdf/mesh_io.h>
#include "bench/measure.h"
#include "demos/shared/shapes.h"
#include "sdf/base/method_names.h"
#include "sdf/base/openvdb.h"

namespace bilayer::bench {
namespace {

const Source carvedBox{"carved box", ""};
const std::string unevenSphere = "uneven sphere ";  // followed by the deviation of its areas

// Returns zero if there is no number; no sphere has deviation zero.
float deviationIn(const std::string& name) {
    float deviation = 0;
    std::istringstream text(name.substr(unevenSphere.size()));
    return text >> deviation && text.eof() ? deviation : 0;
}

// Adapter by which OpenVDB reads the mesh in place, in voxels, without the cost of a copy.
class InVoxels {
  public:
    explicit InVoxels(const Scene& scene) : mesh_(scene.mesh), perMetre_(1 / double(scene.voxelSize)) {}
    std::size_t polygonCount() const { return mesh_.triangles.size(); }
    std::size_t pointCount() const { return mesh_.points.size(); }
    std::size_t vertexCount(std::size_t) const { return 3; }
    void getIndexSpacePoint(std::size_t triangle, std::size_t corner, openvdb::Vec3d& position) const {
        const glm::vec3& p = mesh_.points[mesh_.triangles[triangle][int(corner)]];
        position = openvdb::Vec3d(p.x, p.y, p.z) * perMetre_;
    }

  private:
    const Mesh& mesh_;
    double perMetre_;
};

Outcome runOpenvdb(const Scene& scene, const Job& job) {
    openvdb::initialize();
    const int flags = job.builder == Builder::reference ? openvdb::tools::DISABLE_RENORMALIZATION : 0;
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::size_t(job.threads));
    return tbb::task_arena(job.threads).execute([&] {
        const Stopwatch watch;
        const auto transform = openvdb::math::Transform::createLinearTransform(scene.voxelSize);
        const auto grid = openvdb::tools::meshToVolume<openvdb::FloatGrid>(InVoxels(scene), *transform, job.halfWidth,
                                                                           job.halfWidth, flags);
        return Outcome{watch.seconds(), grid->activeVoxelCount(), grid->memUsage()};
    });
}

Method methodOf(Builder builder) {
    switch (builder) {
        case Builder::reference:
        case Builder::defaults:
            break;
        case Builder::pseudonormal:
            return Method::pseudonormal;
        case Builder::exact:
        case Builder::exactOpencl:
            return Method::exact;
        case Builder::doubleLayer:
        case Builder::doubleLayerOpencl:
            return Method::doubleLayer;
        case Builder::prism:
            return Method::prism;
    }
    throw std::invalid_argument("not a builder of ours");
}

bool isOpencl(Builder builder) {
    return builder == Builder::exactOpencl || builder == Builder::doubleLayerOpencl || builder == Builder::prism;
}

const BlockFiller& openclOnce() {
    static const BlockFiller filler = openclFiller(openDevice(""));
    return filler;
}

Outcome runOurs(const Scene& scene, const Job& job) {
    const Stopwatch watch;
    const LevelSet field = fieldOf(scene, job);
    const double seconds = watch.seconds();
    if (field.method() != detail::nameOf(methodOf(job.builder)))
        throw std::logic_error("the field came from method " + field.method());
    return {seconds, field.activeVoxels(), field.memoryBytes()};
}

}  // namespace

std::filesystem::path corpusFolder() {
    const char* const elsewhere = std::getenv("BILAYER_MESHES");
    return elsewhere && *elsewhere ? elsewhere : BILAYER_MESHES;
}

std::vector<std::string> meshFiles(const std::filesystem::path& folder) {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
        if (entry.is_regular_file() && entry.path().extension() != ".md")
            names.push_back(std::filesystem::relative(entry.path(), folder).string());
    std::sort(names.begin(), names.end());
    return names;
}

std::vector<Source> sources() {
    const std::filesystem::path corpus = corpusFolder();
    std::vector<Source> found;
    for (const auto& [name, file] : {std::pair{"bunny", "bunny_watertight.obj"},
                                     {"dragon", "dragon_vrip_871k.ply"},
                                     {"armadillo", "armadillo_100k.ply"},
                                     {"screwdriver", "screwdriver.off"},
                                     {"fandisk", "fandisk.obj"}})
        if (std::filesystem::exists(corpus / file)) found.push_back({name, (corpus / file).string()});
    found.push_back(carvedBox);
    return found;
}

Source findSource(const std::string& nameOrFile) {
    for (const Source& source : sources())
        if (source.name == nameOrFile) return source;
    if (nameOrFile.starts_with(unevenSphere)) return {nameOrFile, ""};
    if (!std::filesystem::exists(nameOrFile))
        throw std::invalid_argument(fmt::format("no mesh is called {}, and no file", nameOrFile));
    return {std::filesystem::path(nameOrFile).stem().string(), nameOrFile};
}

Scene scene(const std::string& name, Mesh mesh, float resolution) {
    Scene result{name, resolution, std::move(mesh), 0};
    result.voxelSize = voxelSizeFor(result.mesh, resolution);
    return result;
}

Scene scene(const Source& source, float resolution) {
    const auto mesh = [&] {
        if (!source.file.empty()) return readMesh(source.file);
        if (!source.name.starts_with(unevenSphere)) return shapes::carvedBox();
        return shapes::unevenSphere(deviationIn(source.name));
    };
    return scene(source.name, mesh(), resolution);
}

const std::vector<Builder>& builders() {
    static const std::vector<Builder> all{
        Builder::reference,   Builder::defaults,    Builder::pseudonormal,      Builder::exact,
        Builder::doubleLayer, Builder::exactOpencl, Builder::doubleLayerOpencl, Builder::prism};
    return all;
}

const char* nameOf(Builder builder) {
    switch (builder) {
        case Builder::reference:
            return "meshToVolume-0x4";
        case Builder::defaults:
            return "meshToVolume";
        case Builder::pseudonormal:
        case Builder::exact:
        case Builder::doubleLayer:
        case Builder::prism:
            return detail::nameOf(methodOf(builder));
        case Builder::exactOpencl:
            return "exact-opencl";
        case Builder::doubleLayerOpencl:
            return "double-layer-opencl";
    }
    throw std::invalid_argument("no such builder");
}

Builder builderNamed(const std::string& name) {
    const auto found = std::find_if(builders().begin(), builders().end(), [&](Builder b) { return name == nameOf(b); });
    if (found == builders().end()) throw std::invalid_argument("no builder is called " + name);
    return *found;
}

Outcome run(const Scene& scene, const Job& job) {
    const bool openvdb = job.builder == Builder::reference || job.builder == Builder::defaults;
    return openvdb ? runOpenvdb(scene, job) : runOurs(scene, job);
}

LevelSet fieldOf(const Scene& scene, const Job& job) {
    BuildOptions options;
    options.voxelSize = scene.voxelSize;
    options.exteriorWidthVoxels = options.interiorWidthVoxels = job.halfWidth;
    options.method = methodOf(job.builder);
    // the method's own signs: the automatic choice would use those of the exact method
    if (options.method == Method::pseudonormal) options.sign = Sign::normals;
    options.threads = job.threads;
    if (!isOpencl(job.builder)) return build(scene.mesh, options);
    return build(scene.mesh, options, job.filler ? *job.filler : openclOnce());
}

}  // namespace bilayer::bench
