// SPDX-License-Identifier: Apache-2.0
// A recording of moving bodies, rigid ones and ones with changing surfaces, as one HTML file. The file plays in any
// browser with orbit and scrub controls and needs no network.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <bilayer/collider/pose.h>
#include <bilayer/sdf/mesh.h>

namespace bilayer::demo {

/// The appearance of a body, in terms of physically based rendering.
struct Look {
    std::uint32_t colour = 0xcccccc;  ///< sRGB, 0xrrggbb
    float roughness = 0.5f;           ///< 0: mirror, 1: chalk
    float metalness = 0;
    float clearcoat = 0;  ///< clear coating layer, 0..1
    float opacity = 1;    ///< 1: solid, 0: invisible
    bool clear = false;   ///< like water and glass: reflects at any opacity, more at grazing angles; no shadow
};

/// The initial camera. The z axis points up.
struct View {
    glm::vec3 target{0};      ///< the point the camera faces [m]
    float distance = 3;       ///< from the target [m]
    float azimuth = -1.57f;   ///< direction from the target to the camera, from x towards y [rad]
    float elevation = 0.65f;  ///< above the horizon [rad]
    float groundHeight = 0;   ///< z of the ground, which receives shadows [m]
    float moment = -1;        ///< time of the still picture [s]; negative: the end
};

/// Collects bodies and their poses frame by frame, and writes a player that contains them all. Coordinates are stored
/// in 16 bits: to 1/65535 of the bounding box of a mesh, or of all poses. Coordinates of changing surfaces are stored
/// in 12 bits, to 1/4095 of the bounding box of each.
class Recording {
  public:
    explicit Recording(std::string title);

    View view;

    /// Adds a line to the caption, such as "triangles", "2 090 000".
    void note(std::string label, std::string value);

    /// Adds a mesh and returns its index. Edges sharper than `crease` [rad] stay sharp; others are shaded smoothly.
    int addMesh(const Mesh& mesh, float crease = 0.7f);

    /// Adds a body that shows a mesh, and returns its index. Throws std::invalid_argument if the mesh does not exist.
    int addBody(int mesh, const Look& look);

    /// Adds a body with a different surface in each frame, such as a liquid, and returns its index among these.
    int addChanging(const Look& look);

    /// Adds a frame at a time later than the last one [s]: the poses of all bodies, and all changing surfaces in world
    /// coordinates, shaded smoothly, both in their order. The player shows a surface until the next frame. Throws
    /// std::invalid_argument if either count is wrong, if the time is not later, and for surfaces as validate() does; a
    /// surface without triangles is valid.
    void frame(double time, std::span<const Pose> poses, std::span<const Mesh> surfaces = {});

    /// Writes the HTML file, complete or not at all. Throws std::runtime_error that names the faulty file: the target,
    /// or a missing part of three.js (Debian's package libjs-three).
    void write(const std::filesystem::path& path) const;

  private:
    struct Body {
        int mesh;
        Look look;
    };
    /// A mesh of a frame in the player's format.
    struct Packed {
        Bounds box;
        std::vector<std::uint8_t> points, triangles;
    };
    struct Changing {
        Look look;
        std::vector<Packed> frames;
    };
    static Packed pack(const Mesh& mesh);
    std::string data() const;

    std::string title_;
    std::vector<std::pair<std::string, std::string>> notes_;
    std::vector<Mesh> meshes_;
    std::vector<Body> bodies_;
    std::vector<Changing> changing_;
    std::vector<float> times_;
    std::vector<Pose> poses_;  // bodies_.size() per frame
};

}  // namespace bilayer::demo
