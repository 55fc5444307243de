// A recording of bodies in motion, rigid ones and ones whose surface changes: one HTML file that plays, orbits and
// scrubs in any browser, with no network.
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

/// How a body's surface looks; the words are those of physically based rendering.
struct Look {
    std::uint32_t colour = 0xcccccc;  ///< sRGB, 0xrrggbb
    float roughness = 0.5f;           ///< 0: mirror, 1: chalk
    float metalness = 0;
    float clearcoat = 0;  ///< a glaze over it, 0..1
    float opacity = 1;    ///< 1: solid, 0: invisible
    bool clear = false;   ///< as water and glass: mirrors however see-through it is, the more along it, without shadow
};

/// Where the camera starts. The z axis points up.
struct View {
    glm::vec3 target{0};      ///< the point it looks at [m]
    float distance = 3;       ///< from the target [m]
    float azimuth = -1.57f;   ///< of the camera seen from the target, from x towards y [rad]
    float elevation = 0.65f;  ///< above the horizon [rad]
    float groundHeight = 0;   ///< z of the ground, which catches shadows [m]
    float moment = -1;        ///< that a still picture shows [s]; negative: the end
};

/// Collects bodies and their poses, frame by frame, and writes the player with all of them in it. Coordinates are kept
/// in 16 bits: to 1/65535 of a mesh's box, and of the box that all poses need. Those of surfaces that change are kept
/// in 12 bits, to 1/4095 of the box of each.
class Recording {
  public:
    explicit Recording(std::string title);

    View view;

    /// A line of the caption, such as "triangles", "2 090 000".
    void note(std::string label, std::string value);

    /// Adds a mesh and returns its index. Edges sharper than `crease` [rad] stay sharp, others are shaded smoothly.
    int addMesh(const Mesh& mesh, float crease = 0.7f);

    /// Adds a body that shows a mesh, and returns its index. Throws std::invalid_argument for a mesh that is not there.
    int addBody(int mesh, const Look& look);

    /// Adds a body whose surface is another one in each frame, such as a liquid, and returns its index among these.
    int addChanging(const Look& look);

    /// The poses of all bodies, and the surfaces of all that change, in the world's coordinates and smooth, both in
    /// their order, at a time later than the last [s]. The player shows a surface until the next frame. Throws
    /// std::invalid_argument for another number of either, a time that is not later, and surfaces as validate() does;
    /// one without triangles is well.
    void frame(double time, std::span<const Pose> poses, std::span<const Mesh> surfaces = {});

    /// Writes the HTML file, whole or not at all. Throws std::runtime_error that names the file at fault: the target,
    /// or a part of three.js (Debian's package libjs-three) that is missing.
    void write(const std::filesystem::path& path) const;

  private:
    struct Body {
        int mesh;
        Look look;
    };
    /// A mesh of a frame as the player unpacks it.
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
    std::vector<Pose> poses_;  // bodies_.size() a frame
};

}  // namespace bilayer::demo
