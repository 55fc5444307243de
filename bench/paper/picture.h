// Pictures of fields and of the meshes that they are from, by OpenVDB's ray tracer: one camera and one shader for both;
// where a ray meets a mesh, its triangles say.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>
#include <vector>

#include <bilayer/sdf/level_set.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer::paper {

/// Rows of red, green, blue from the top.
struct Picture {
    int width = 0, height = 0;
    std::vector<std::uint8_t> pixels;
};

/// Where one looks from: without perspective.
struct View {
    glm::dvec3 centre;  ///< in the middle of the picture [m]
    glm::dvec3 from;    ///< direction from there to the eye
    glm::dvec3 up{0, 1, 0};
    double width;  ///< of what is seen [m]
    int pixels = 480, lines = 480;
};

/// The zero surface of a field.
Picture picture(const LevelSet& field, const View& view);

/// A mesh, each triangle flat.
Picture picture(const Mesh& mesh, const View& view);

/// Pictures of one size side by side in rows, with a gap between.
Picture mosaic(const std::vector<Picture>& pictures, int columns);

/// Writes a JPEG, as good as the bytes allow. Throws std::runtime_error that names the file when it cannot be written.
void writeJpeg(const std::filesystem::path& path, const Picture& picture, std::size_t maxBytes = 245'000);

}  // namespace bilayer::paper
