// SPDX-License-Identifier: Apache-2.0
// Pictures of fields and of their source meshes by OpenVDB's ray tracer, with the same camera and shader. Ray hits on a
// mesh use its triangles.
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

/// An orthographic view.
struct View {
    glm::dvec3 centre;  ///< centre of the picture [m]
    glm::dvec3 from;    ///< direction from the centre to the eye
    glm::dvec3 up{0, 1, 0};
    double width;  ///< width of the visible area [m]
    int pixels = 480, lines = 480;
};

/// The zero surface of a field.
Picture picture(const LevelSet& field, const View& view);

/// A mesh with flat shading.
Picture picture(const Mesh& mesh, const View& view);

/// Arranges pictures of equal size in rows, with a gap between them.
Picture mosaic(const std::vector<Picture>& pictures, int columns);

/// Writes a JPEG of the highest quality within the size limit. Throws std::runtime_error with the file name if it
/// cannot be written.
void writeJpeg(const std::filesystem::path& path, const Picture& picture, std::size_t maxBytes = 245'000);

}  // namespace bilayer::paper
