// SPDX-License-Identifier: Apache-2.0
#include "demos/scenes/pairs.h"

#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btBvhTriangleMeshShape.h>
#include <BulletCollision/CollisionShapes/btCapsuleShape.h>
#include <BulletCollision/CollisionShapes/btCompoundShape.h>
#include <BulletCollision/CollisionShapes/btConeShape.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/CollisionShapes/btCylinderShape.h>
#include <BulletCollision/CollisionShapes/btHeightfieldTerrainShape.h>
#include <BulletCollision/CollisionShapes/btMultiSphereShape.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>
#include <BulletCollision/CollisionShapes/btStaticPlaneShape.h>
#include <BulletCollision/CollisionShapes/btTriangleMesh.h>
#include <BulletCollision/Gimpact/btGImpactShape.h>
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <glm/trigonometric.hpp>

#include <bilayer/integration/bullet/shape.h>
#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "demos/shared/stage.h"
#include "demos/shared/triangle_shape.h"

namespace bilayer::demo {
namespace {

// All lengths are at scale 1 [m].
constexpr float voxel = 0.05f;
constexpr glm::vec3 halfBox{0.5f, 0.4f, 0.3f};  // upper bodies
constexpr float ball = 0.4f, major = 0.5f, minor = 0.2f;
constexpr float halfSlab = 0.8f, halfThickness = 0.3f;  // lower bodies
constexpr float fall = 0.2f;                            // initial height above the lower body [voxels]
constexpr float rolling = 0.04f;  // rolling friction: round bodies would otherwise roll off the lower body
constexpr float lane = 2;
constexpr int columns = 16;  // of the board
constexpr int framesPerMeasuring = 30;
constexpr int samplesAlong = 9;  // of a height field
constexpr float mass = 2;        // at scale 1; it grows with the scale, since Bullet treats small inverses as zero [kg]
constexpr double maxError = 0.1;  // of heights and penetrations [voxels], of tilts [degrees]

constexpr std::uint32_t fieldColour = 0xe07a5f, shapeColour = 0x9db4d6;

// A body and its resting state.
struct Part {
    std::string name;
    std::shared_ptr<const BodyPrototype> prototype;
    float below, above;       // height of its centre above its lowest point, and of its top above its centre [m]
    glm::vec3 axis{0, 0, 1};  // vertical or horizontal, initially and at rest; zero: it may roll
    bool isField = false;
};

struct Cell {
    std::string name;
    std::size_t upper;  // index among the stage's bodies
    float height;       // at rest [m]
    glm::vec3 axis;
};

btVector3 toBullet(const glm::vec3& v) {
    return {v.x, v.y, v.z};
}

// Keeps a shape together with the triangles, heights or children that it points to.
struct ConcaveShape {
    explicit ConcaveShape(const Mesh& mesh) : mesh(mesh), shape(&this->mesh.triangles) {
        shape.setMargin(0);
        shape.updateBound();
    }
    TriangleShape mesh;
    btGImpactMeshShape shape;
};

struct HeightShape {
    explicit HeightShape(float width)
        : heights(samplesAlong * samplesAlong, 0.f),
          shape(samplesAlong, samplesAlong, heights.data(), 1, -1, 1, 2, PHY_FLOAT, false) {
        const float cell = width / (samplesAlong - 1);
        shape.setLocalScaling({cell, cell, cell});
    }
    std::vector<float> heights;
    btHeightfieldTerrainShape shape;
};

struct CompoundShape {
    CompoundShape(std::shared_ptr<btCollisionShape> part, const std::vector<glm::vec3>& places)
        : child(std::move(part)) {
        for (const glm::vec3& place : places)
            shape.addChildShape(btTransform(btQuaternion::getIdentity(), toBullet(place)), child.get());
    }
    std::shared_ptr<btCollisionShape> child;
    btCompoundShape shape;
};

Mesh moved(Mesh mesh, const glm::vec3& by, const glm::quat& rotation = {1, 0, 0, 0}) {
    for (glm::vec3& point : mesh.points) point = rotation * point + by;
    return mesh;
}

// Makes parts at a scale.
class Maker {
  public:
    explicit Maker(float scale) : s_(scale) {}

    // Upper bodies: fields, and Bullet's shapes.
    std::vector<Part> fields() const {
        return {field("field of a box", shapes::box(s_ * halfBox, 4), halfBox.z),
                field("field of a ball", shapes::sphere(s_ * ball, 5), ball, glm::vec3(0)),
                field("field of a ring", shapes::torus(s_ * major, s_ * minor), minor), scaledField()};
    }
    std::vector<Part> shapesOfBullet() const {
        const glm::quat level = glm::angleAxis(glm::half_pi<float>(), glm::vec3(0, 1, 0));
        const auto box = std::make_shared<btBoxShape>(toBullet(s_ * halfBox));
        const glm::vec3 halfCube(0.2f * s_);
        const auto cube = std::make_shared<btBoxShape>(toBullet(halfCube));
        const std::vector<glm::vec3> two{{-0.3f * s_, 0, 0}, {0.3f * s_, 0, 0}};
        const auto compound = std::make_shared<CompoundShape>(cube, two);
        const auto cubes = shapes::join({moved(shapes::box(halfCube), two[0]), moved(shapes::box(halfCube), two[1])});
        return {part("box", shapes::box(s_ * halfBox), box, halfBox.z),
                part("sphere", shapes::sphere(s_ * ball, 4), std::make_shared<btSphereShape>(s_ * ball), ball,
                     glm::vec3(0)),
                part("capsule", capsule(), std::make_shared<btCapsuleShapeX>(s_ * 0.3f, s_ * 0.8f), 0.3f, {1, 0, 0}),
                part("cylinder", shapes::cylinder(s_ * 0.4f, s_ * 0.6f),
                     std::make_shared<btCylinderShapeZ>(s_ * btVector3(0.4f, 0.4f, 0.3f)), 0.3f),
                part("cylinder, lying", moved(shapes::cylinder(s_ * 0.3f, s_ * 0.8f), glm::vec3(0), level),
                     std::make_shared<btCylinderShapeX>(s_ * btVector3(0.4f, 0.3f, 0.3f)), 0.3f, {1, 0, 0}),
                cone(),
                hull("hull", halfBox),
                multisphere(),
                concave(),
                part("compound", cubes, {compound, &compound->shape}, 0.2f)};
    }
    // Lower bodies with a flat top.
    std::vector<Part> tops() const {
        const glm::vec3 half(halfSlab, halfSlab, halfThickness);
        const Mesh slab = shapes::box(s_ * half, 6);
        const auto box = std::make_shared<btBoxShape>(toBullet(s_ * half));
        const auto triangles = std::make_shared<TriangleShape>(slab);
        const auto heights = std::make_shared<HeightShape>(2 * s_ * halfSlab);
        const auto compound = std::make_shared<CompoundShape>(box, std::vector{glm::vec3(0)});
        // the space below a height field counts as ground too
        const Mesh below = moved(slab, {0, 0, -s_ * halfThickness});
        return {part("box", slab, box, halfThickness),
                hull("hull", half),
                part("cylinder", shapes::cylinder(s_ * halfSlab, 2 * s_ * halfThickness),
                     std::make_shared<btCylinderShapeZ>(toBullet(s_ * half)), halfThickness),
                part("triangle mesh", slab, {triangles, triangles->shape.get()}, halfThickness),
                part("height field", below, {heights, &heights->shape}, 0),
                part("compound", slab, {compound, &compound->shape}, halfThickness),
                fieldSlab()};
    }
    // The ground below everything on the board.
    Part ground() const {
        const float half = 0.5f * lane * columns, thin = halfThickness / 4;
        const auto plane = std::make_shared<btStaticPlaneShape>(btVector3(0, 0, 1), -s_ * halfThickness);
        const Mesh mesh = moved(shapes::box(s_ * glm::vec3(half + lane, half + lane, thin)),
                                s_ * glm::vec3(half, half, -halfThickness - thin));
        return part("plane", mesh, plane, 0);
    }
    // Represents the ground where it is the lower body.
    Part onGround() const { return {"plane", nullptr, 0, -s_ * halfThickness}; }
    Part fieldSlab() const {
        return field("field", shapes::box(s_ * glm::vec3(halfSlab, halfSlab, halfThickness), 6), halfThickness);
    }

  private:
    // A field that Bullet scales to a different size than its mesh.
    Part scaledField() const {
        constexpr float factor = 2.5f;
        const Mesh small = shapes::box(s_ / factor * halfBox, 4);
        const float fine = s_ / factor * voxel;
        const auto collider =
            std::make_shared<Collider>(small, build(small, {.voxelSize = fine, .interiorWidthVoxels = 6}));
        const auto shape = std::make_shared<bullet::Shape>(collider);
        shape->setLocalScaling({factor, factor, factor});
        Part scaled = part("field, scaled,", shapes::box(s_ * halfBox), shape, halfBox.z);
        scaled.isField = true;
        return scaled;
    }
    Part concave() const {
        const auto shape = std::make_shared<ConcaveShape>(shapes::box(s_ * halfBox));
        return part("GImpact", shapes::box(s_ * halfBox), {shape, &shape->shape}, halfBox.z);
    }
    Part field(const std::string& name, Mesh mesh, float height, const glm::vec3& axis = {0, 0, 1}) const {
        return {name, makePrototype(std::move(mesh), {.voxelSize = s_ * voxel}), s_ * height, s_ * height, axis, true};
    }
    Part part(const std::string& name, Mesh mesh, std::shared_ptr<btCollisionShape> shape, float height,
              const glm::vec3& axis = {0, 0, 1}) const {
        return {name, makePrototype(std::move(mesh), std::move(shape), s_ * voxel), s_ * height, s_ * height, axis};
    }
    // Bullet grows hulls and cones by their margin.
    Part hull(const std::string& name, const glm::vec3& half) const {
        const auto shape = std::make_shared<btConvexHullShape>();
        const float margin = 0.1f * voxel;
        const glm::vec3 inner = s_ * (half - margin);
        for (int i = 0; i < 8; ++i)
            shape->addPoint({i & 1 ? inner.x : -inner.x, i & 2 ? inner.y : -inner.y, i & 4 ? inner.z : -inner.z});
        shape->setMargin(s_ * margin);
        return part(name, shapes::box(s_ * half), shape, half.z);
    }
    Part cone() const {
        const auto shape = std::make_shared<btConeShapeZ>(s_ * 0.4f, s_ * 0.6f);
        shape->setMargin(0);
        return part("cone", shapes::cone(s_ * 0.4f, s_ * 0.6f), shape, 0.3f);
    }
    Part multisphere() const {
        const btVector3 centres[] = {s_ * btVector3(-0.3f, -0.2f, 0), s_ * btVector3(0.3f, -0.2f, 0),
                                     s_ * btVector3(0, 0.3f, 0)};
        const float radii[] = {s_ * 0.25f, s_ * 0.25f, s_ * 0.25f};
        std::vector<Mesh> balls;
        for (const btVector3& centre : centres)
            balls.push_back(moved(shapes::sphere(radii[0], 4), {centre.x(), centre.y(), centre.z()}));
        const auto shape = std::make_shared<btMultiSphereShape>(centres, radii, 3);
        // a field sees the balls as they are, but Bullet's own shapes around would meet its 4 cm at any scale
        shape->setMargin(0.95f * radii[0]);
        return part("multisphere", shapes::join(balls), shape, 0.25f);
    }
    Mesh capsule() const {
        std::vector<glm::vec2> profile;
        constexpr int steps = 24;
        for (int i = 0; i <= 2 * steps + 1; ++i) {
            const bool upper = i > steps;
            const float angle = glm::pi<float>() * (float(upper ? i - 1 : i) / (2 * steps) - 0.5f);
            profile.push_back(s_ * glm::vec2(i == 0 || i == 2 * steps + 1 ? 0 : 0.3f * std::cos(angle),
                                             0.3f * std::sin(angle) + (upper ? 0.4f : -0.4f)));
        }
        return moved(shapes::revolve(profile, 48), glm::vec3(0),
                     glm::angleAxis(glm::half_pi<float>(), glm::vec3(0, 1, 0)));
    }

    float s_;
};

// The motion type of the lower body.
enum class State { fixed, kinematic, moving };

std::string nameOf(State state) {
    return state == State::fixed ? "static" : state == State::kinematic ? "kinematic" : "dynamic";
}

// Places pairs on a grid.
class Board {
  public:
    Board(Stage& stage, const PairsOptions& options)
        : stage_(stage), scale_(options.scale), every_(options.every), only_(options.only) {}

    /// An infinite plane; everything else must be above it.
    void addGround(const Part& ground) {
        stage_.add(ground.prototype, {}, {}, {.colour = 0xcfd6dd});
        ++bodies_;
    }
    void add(const Part& upper, const Part& lower, State state, bool upperFirst) {
        const std::string name =
            fmt::format("{} on {} {}, {} first", upper.name, nameOf(state), lower.name, upperFirst ? "upper" : "lower");
        if (asked_++ % every_ != 0 || name.find(only_) == std::string::npos) return;
        const int n = int(cells_.size());
        const glm::vec3 place = scale_ * lane * glm::vec3(n % columns, n / columns, 0);
        const float rest = lower.above + upper.below;
        const Pose above{place + glm::vec3(0, 0, rest + scale_ * fall * voxel)};
        if (!upperFirst && lower.prototype) addLower(lower, state, {place});
        const std::size_t index = bodies_;
        addBody(upper, matter(scale_ * mass, mayRoll(upper)), above);
        if (upperFirst && lower.prototype) addLower(lower, state, {place});
        cells_.push_back({name, index, rest, upper.axis});
    }

    const std::vector<Cell>& cells() const { return cells_; }

  private:
    // Upright bodies must not roll: they could come to rest on an edge, at an angle.
    static bool mayRoll(const Part& part) { return part.axis.z == 0; }

    // Bodies a hundred times as large fall ten times as fast and rotate ten times as slowly. The sleeping thresholds
    // are a tenth of the usual, so that rocking bodies do not freeze at an angle.
    Matter matter(float bodyMass, bool rolls = false) const {
        const Matter usual;
        return {.mass = bodyMass,
                .rollingFriction = rolls ? scale_ * rolling : 0,
                .restingSpeed = 0.1f * usual.restingSpeed * std::sqrt(scale_),
                .restingSpin = 0.1f * usual.restingSpin / std::sqrt(scale_)};
    }
    btRigidBody& addBody(const Part& part, const Matter& matter, const Pose& pose) {
        ++bodies_;
        const std::uint32_t colour = part.isField ? fieldColour : shapeColour;
        return stage_.add(part.prototype, matter, pose, {.colour = colour, .roughness = 0.4f, .clearcoat = 0.2f});
    }
    void addLower(const Part& part, State state, const Pose& pose) {
        btRigidBody& body = addBody(part, matter(state == State::moving ? scale_ * mass : 0), pose);
        if (state != State::kinematic) return;
        body.setCollisionFlags(body.getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
        body.setActivationState(DISABLE_DEACTIVATION);
    }

    Stage& stage_;
    float scale_;
    int every_, asked_ = 0;
    std::string only_;
    std::size_t bodies_ = 0;
    std::vector<Cell> cells_;
};

struct Parts {
    explicit Parts(const Maker& maker)
        : fields(maker.fields()),
          shapes(maker.shapesOfBullet()),
          tops(maker.tops()),
          slab(maker.fieldSlab()),
          plane(maker.onGround()) {}

    std::vector<Part> fields, shapes, tops;
    Part slab, plane;
};

// Adds all pairs in which the upper, or the lower, body was created first.
void addAll(Board& board, const Parts& parts, bool upperFirst) {
    const auto& [fields, shapes, tops, slab, plane] = parts;
    for (const State state : {State::fixed, State::kinematic}) {
        for (const Part& lower : tops)
            for (const Part& upper : fields) board.add(upper, lower, state, upperFirst);
        for (const Part& upper : shapes) board.add(upper, slab, state, upperFirst);
    }
    for (const Part& upper : fields) board.add(upper, plane, State::fixed, upperFirst);
    for (const auto* uppers : {&fields, &shapes})
        for (const Part& upper : *uppers) board.add(upper, slab, State::moving, upperFirst);
}

// Returns the angle between a body's axis and its initial vertical or horizontal direction [degrees].
double tiltOf(const Pose& pose, const glm::vec3& axis) {
    const glm::dvec3 now = glm::dquat(pose.rotation) * glm::dvec3(axis);
    const double aside = std::hypot(now.x, now.y);
    return axis == glm::vec3(0)
               ? 0
               : glm::degrees(axis.z > 0 ? std::atan2(aside, now.z) : std::atan2(std::abs(now.z), aside));
}

}  // namespace

Outcome pairs(const PairsOptions& options) {
    const float scale = options.scale;
    Stage stage(fmt::format("Every shape and a field, at scale {:g}", scale),
                {.stepsPerSecond = options.stepsPerSecond, .framesPerMeasuring = framesPerMeasuring});
    stage.world().bullet().getSolverInfo().m_numIterations = options.iterations;
    const Maker maker(scale);
    const Parts parts(maker);
    Board board(stage, options);
    // the order of a pair is that in which its bodies were added
    addAll(board, parts, true);
    board.addGround(maker.ground());
    addAll(board, parts, false);
    stage.run(options.seconds * std::max(1.f, std::sqrt(scale)));

    double worstHeight = 0, worstTilt = 0;
    std::vector<std::pair<std::string, std::string>> missed;
    const std::vector<Pose> poses = stage.world().poses();
    for (const Cell& cell : board.cells()) {
        const Pose& pose = poses[cell.upper];
        const double height = (double(pose.position.z) - cell.height) / (scale * voxel), tilt = tiltOf(pose, cell.axis);
        worstHeight = worse(worstHeight, std::abs(height));
        worstTilt = worse(worstTilt, tilt);
        if (!(std::abs(height) <= maxError && tilt <= maxError))
            missed.emplace_back(cell.name, fmt::format("{:+.3f} voxels high, {:.3f} degrees", height, tilt));
    }
    const float width = scale * lane * columns;
    Outcome outcome = stage.finish({.target = {0.46f * width, width / 4, 0},
                                    .distance = 1.6f * width,
                                    .elevation = 0.7f,
                                    .groundHeight = -scale * halfThickness});
    outcome.facts = {{"pairs", std::to_string(board.cells().size())}};
    outcome.facts.insert(outcome.facts.end(), missed.begin(), missed.end());
    outcome.criteria = {{"height off", worstHeight, maxError, "voxels"},
                        {"tilt", worstTilt, maxError, "degrees"},
                        {"deepest penetration", outcome.deepest() / outcome.voxelSize, maxError, "voxels"}};
    return outcome;
}

}  // namespace bilayer::demo
