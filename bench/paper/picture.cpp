// SPDX-License-Identifier: Apache-2.0
#include "bench/paper/picture.h"

#include <openvdb/tools/RayTracer.h>
// cstdio's FILE must be known first
#include <jpeglib.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <stdexcept>

#include <bilayer/sdf/grids.h>
#include "collider/field/triangles/mesh_rays.h"
#include "sdf/base/openvdb.h"

namespace bilayer::paper {

using namespace bilayer::detail;
namespace {

using openvdb::Vec3d;
using Colour = openvdb::tools::Film::RGBA;
using Ray = openvdb::math::Ray<double>;

constexpr std::size_t raysPerPixel = 6;
constexpr int gap = 6;  // between the pictures of a mosaic [pixels]
const Colour paperWhite(0.985f, 0.98f, 0.97f);

Vec3d toVdb(const glm::dvec3& v) {
    return {v.x, v.y, v.z};
}

// A matt surface with a strong light at the upper left, and weak light from the eye and from below. Front faces are
// grey blue, back faces orange.
class Studio : public openvdb::tools::BaseShader {
  public:
    Studio(const Vec3d& right, const Vec3d& up, const Vec3d& back)
        : lamp_((-0.55 * right + 0.75 * up + 0.6 * back).unit()), back_(back) {}

    Colour operator()(const Vec3d&, const Vec3d& normal, const Vec3d& direction) const override {
        const bool outside = normal.dot(direction) <= 0;
        const Vec3d n = outside ? normal : -normal;
        const double light = 0.2 + 0.62 * std::max(0.0, n.dot(lamp_)) + 0.22 * std::max(0.0, n.dot(back_));
        const Colour colour = outside ? Colour(0.70f, 0.79f, 0.88f) : Colour(0.88f, 0.54f, 0.24f);
        const auto lit = [&](float c) { return float(std::pow(std::min(1.0, double(c) * light), 1 / 1.6)); };
        return {lit(colour.r), lit(colour.g), lit(colour.b)};
    }
    openvdb::tools::BaseShader* copy() const override { return new Studio(*this); }

  private:
    Vec3d lamp_, back_;
};

// The interface that OpenVDB's tracer requires of an intersector, on triangles.
class MeshIntersector {
  public:
    using Vec3Type = Vec3d;
    using RayType = Ray;

    explicit MeshIntersector(const Mesh& mesh)
        : tree_(std::make_shared<MeshTree>(mesh, bounds(mesh).longestSide() / 256)) {}

    bool intersectsWS(const Ray& ray, Vec3d& place, Vec3d& normal) const {
        const Path path{{ray.eye()[0], ray.eye()[1], ray.eye()[2]},
                        {ray.dir()[0], ray.dir()[1], ray.dir()[2]},
                        std::numeric_limits<double>::infinity()};
        const auto hit = firstHit(*tree_, path);
        if (!hit) return false;
        const Mesh& mesh = tree_->mesh();
        const glm::uvec3& t = mesh.triangles[hit->triangle];
        const glm::dvec3 a(mesh.points[t.x]), b(mesh.points[t.y]), c(mesh.points[t.z]);
        place = toVdb(hit->position);
        normal = toVdb(glm::normalize(glm::cross(b - a, c - a)));
        return true;
    }

  private:
    std::shared_ptr<const MeshTree> tree_;
};

template <class Intersector>
Picture traced(const Intersector& intersector, const View& view) {
    openvdb::tools::Film film(std::size_t(view.pixels), std::size_t(view.lines), paperWhite);
    const glm::dvec3 back = glm::normalize(view.from), right = glm::normalize(glm::cross(view.up, back)),
                     up = glm::cross(back, right);
    openvdb::tools::OrthographicCamera camera(film, Vec3d(0.0), toVdb(view.centre + 4 * view.width * back), view.width);
    camera.lookAt(toVdb(view.centre), toVdb(view.up));
    const Studio studio(toVdb(right), toVdb(up), toVdb(back));
    openvdb::tools::LevelSetRayTracer<openvdb::FloatGrid, Intersector> tracer(intersector, studio, camera,
                                                                              raysPerPixel);
    tracer.render();
    const auto bytes = film.convertToBitBuffer<std::uint8_t>(false);
    return {view.pixels, view.lines, {bytes.get(), bytes.get() + 3 * view.pixels * view.lines}};
}

std::vector<std::uint8_t> jpeg(const Picture& picture, int quality) {
    jpeg_compress_struct state{};
    jpeg_error_mgr errors{};
    state.err = jpeg_std_error(&errors);
    jpeg_create_compress(&state);
    unsigned char* bytes = nullptr;
    unsigned long size = 0;
    jpeg_mem_dest(&state, &bytes, &size);
    state.image_width = JDIMENSION(picture.width);
    state.image_height = JDIMENSION(picture.height);
    state.input_components = 3;
    state.in_color_space = JCS_RGB;
    jpeg_set_defaults(&state);
    jpeg_set_quality(&state, quality, TRUE);
    jpeg_start_compress(&state, TRUE);
    for (int line = 0; line < picture.height; ++line) {
        auto* row = const_cast<std::uint8_t*>(&picture.pixels[std::size_t(3 * line * picture.width)]);
        jpeg_write_scanlines(&state, &row, 1);
    }
    jpeg_finish_compress(&state);
    jpeg_destroy_compress(&state);
    std::vector<std::uint8_t> result(bytes, bytes + size);
    std::free(bytes);
    return result;
}

}  // namespace

Picture picture(const LevelSet& field, const View& view) {
    using Intersector = openvdb::tools::LevelSetRayIntersector<openvdb::FloatGrid>;
    return traced(Intersector(*field.grids().distance), view);
}

Picture picture(const Mesh& mesh, const View& view) {
    return traced(MeshIntersector(mesh), view);
}

Picture mosaic(const std::vector<Picture>& pictures, int columns) {
    const int count = int(pictures.size()), rows = (count + columns - 1) / columns;
    const int w = pictures.at(0).width, h = pictures.at(0).height;
    Picture all{columns * w + (columns - 1) * gap, rows * h + (rows - 1) * gap, {}};
    all.pixels.assign(std::size_t(3 * all.width * all.height), 255);
    for (int i = 0; i < count; ++i)
        for (int line = 0; line < h; ++line) {
            const int x = i % columns * (w + gap), y = i / columns * (h + gap) + line;
            std::copy_n(&pictures[std::size_t(i)].pixels[std::size_t(3 * line * w)], 3 * w,
                        &all.pixels[std::size_t(3 * (y * all.width + x))]);
        }
    return all;
}

void writeJpeg(const std::filesystem::path& path, const Picture& picture, std::size_t maxBytes) {
    std::vector<std::uint8_t> bytes;
    for (int quality = 92; quality >= 40; quality -= 4) {
        bytes = jpeg(picture, quality);
        if (bytes.size() <= maxBytes) break;
    }
    std::ofstream file(path, std::ios::binary);
    file.write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
    if (!file.flush()) throw std::runtime_error("cannot write " + path.string());
}

}  // namespace bilayer::paper
