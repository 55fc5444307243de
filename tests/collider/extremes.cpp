// SPDX-License-Identifier: Apache-2.0
// Queries with arbitrary floats: nothing crashes or hangs, and all answers are valid.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <vector>

#include <bilayer/collider/collider.h>
#include <bilayer/collider/contact.h>
#include <bilayer/collider/distance.h>
#include <bilayer/collider/field.h>
#include <bilayer/collider/shapes.h>
#include <bilayer/sdf/build.h>
#include "demos/shared/shapes.h"
#include "tests/support/analytic.h"
#include "tests/support/contacts.h"
#include "tests/support/random.h"
#include "tests/support/support.h"

namespace bilayer::extremes_test {
using namespace bilayer::test;

namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr float radius = 0.5f, voxel = 0.08f;

Mesh sphereMesh() {
    return shapes::sphere(radius, 4);
}

const Field& withMesh() {
    static const Field field(build(sphereMesh(), {.voxelSize = voxel}), sphereMesh());
    return field;
}

const Field& withoutMesh() {
    static const Field field(build(sphereMesh(), {.voxelSize = voxel}));
    return field;
}

// Numbers of all magnitudes, including NaN and infinities.
class Extremes {
  public:
    explicit Extremes(unsigned seed) : random_(seed) {}

    float number() {
        constexpr float none = std::numeric_limits<float>::quiet_NaN();
        const std::array<float, 8> special{0.f,  -0.f,     std::numeric_limits<float>::denorm_min(),
                                           none, infinity, std::numeric_limits<float>::max(),
                                           0.5f, 1};
        const double kind = random_(0, 1);
        const float sign = random_(0, 1) < 0.5 ? -1 : 1;
        if (kind < 0.2) return sign * special[std::size_t(random_(0, 7.999))];
        if (kind < 0.6) return float(random_(-1, 1));
        return sign * float(std::exp2(random_(-149, 128)));
    }
    float finite() {
        for (;;)
            if (const float f = number(); std::isfinite(f)) return f;
    }
    // Mostly all three of one magnitude, so that few of a billion directions are along an axis.
    glm::vec3 vector() {
        if (random_(0, 1) < 0.5) return {number(), number(), number()};
        return std::abs(number()) * random_.direction();
    }
    double operator()(double low, double high) { return random_(low, high); }

  private:
    Random random_;
};

bool isFinite(const glm::vec3& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// Whether the vector is of unit length.
bool isUnit(const glm::vec3& v) {
    return std::abs(glm::length(v) - 1) < 1e-4f;
}

void checkPoint(const Field& field, const glm::vec3& point, float maxDistance) {
    CAPTURE(point.x, point.y, point.z, maxDistance);
    const Sample sample = field.sample(point);
    REQUIRE_FALSE(std::isnan(sample.distance));
    REQUIRE(field.distance(point) == sample.distance);
    const bool inside = field.inside(point);
    const ClosestPoint closest = field.closest(point, maxDistance);
    if (!isFinite(point)) {
        REQUIRE(sample.distance == infinity);
        REQUIRE_FALSE(inside);
        REQUIRE_FALSE(closest.found);
        return;
    }
    const double truth = glm::length(glm::dvec3(point)) - double(radius);
    // the sphere's triangles lie within 0.003 of it
    if (std::abs(truth) > 0.02 * radius) {
        REQUIRE(inside == (truth < 0));
        REQUIRE(std::signbit(sample.distance) == (truth < 0));
    }
    if (!sample.inBand) REQUIRE(std::abs(double(sample.distance)) <= std::abs(truth) + 0.003 * radius);
    if (!closest.found) {
        const bool surely = std::abs(truth) * (1 + 1e-6) + 0.02 * radius < double(maxDistance);
        REQUIRE_FALSE(surely);
        return;
    }
    REQUIRE(std::abs(closest.distance) <= maxDistance);
    const double told = std::min(truth, double(std::numeric_limits<float>::max()));
    REQUIRE(std::abs(double(closest.distance) - told) <= 1e-6 * std::abs(truth) + 0.02 * radius);
    REQUIRE(std::abs(glm::length(closest.position) - radius) < 0.02f * radius);
    REQUIRE(isUnit(closest.normal));
}

void checkHit(const Field& field, const std::optional<RayHit>& hit, const Ray& ray, float ofRadius) {
    CAPTURE(ray.origin.x, ray.origin.y, ray.origin.z, ray.direction.x, ray.direction.y, ray.direction.z,
            ray.maxDistance, ofRadius);
    const bool valid = isFinite(ray.origin) && isFinite(ray.direction) && ray.direction != glm::vec3(0) &&
                       ray.maxDistance >= 0 && ofRadius >= 0 && std::isfinite(ofRadius);
    const double away = glm::length(glm::dvec3(ray.origin));
    if (!hit) {
        const bool surely = valid && away < 0.9 * double(radius);
        REQUIRE_FALSE(surely);
        return;
    }
    REQUIRE(valid);
    REQUIRE(hit->distance >= 0);
    REQUIRE(double(hit->distance) <= double(ray.maxDistance) * (1 + 1e-6) + 1e-5);
    REQUIRE(isFinite(hit->position));
    REQUIRE(isUnit(hit->normal));
    if (hit->distance > 0) REQUIRE(std::abs(glm::length(hit->position) - radius) < 0.02f * radius);
    const double told = std::min(away, double(std::numeric_limits<float>::max()));
    if (hit->distance > 0)
        REQUIRE(std::abs(double(hit->distance) - told) <= double(radius + ofRadius) * 1.01 + 1e-6 * away);
    REQUIRE((hit->triangle == noTriangle || field.mesh()));
}

void checkQueries(const Field& field, unsigned seed, int count) {
    CAPTURE(seed);
    Extremes extreme(seed);
    for (int i = 0; i < count; ++i) {
        CAPTURE(i);
        const glm::vec3 point = extreme.vector();
        checkPoint(field, point, i % 2 ? infinity : std::abs(extreme.number()));
        // every other ray points towards the sphere
        const glm::vec3 direction = i % 2 ? -point : extreme.vector();
        const Ray ray{point, direction, i % 3 ? infinity : extreme.number()};
        checkHit(field, field.raycast(ray), ray, 0);
        const float ofRadius = i % 4 ? std::abs(extreme.number()) : extreme.number();
        checkHit(field, field.sphereCast(ray, ofRadius), ray, ofRadius);
        const glm::vec3 other = extreme.vector();
        const auto hit = field.segment(point, other);
        if (hit) REQUIRE((isFinite(point) && isFinite(other) && isUnit(hit->normal)));
        const double away = glm::length(glm::dvec3(point));
        const bool known = isFinite(point) && std::isfinite(ofRadius) && ofRadius >= 0 &&
                           std::abs(away - double(radius + ofRadius)) > 0.02 * double(radius) + 1e-6 * away;
        CAPTURE(point.x, point.y, point.z, ofRadius);
        if (known) REQUIRE(field.overlapsSphere(point, ofRadius) == (away < double(radius + ofRadius)));
        const glm::vec3 half = glm::abs(extreme.vector());
        const glm::quat rotation(extreme.number(), extreme.number(), extreme.number(), extreme.number());
        const bool overlaps = field.overlapsBox({point, half, i % 2 ? rotation : glm::quat(1, 0, 0, 0)});
        CAPTURE(half.x, half.y, half.z);
        if (i % 2 == 0 && isFinite(point) && isFinite(half)) {
            const glm::dvec3 nearest = glm::max(glm::abs(glm::dvec3(point)) - glm::dvec3(half), 0.0);
            const double off = glm::length(nearest) - double(radius);
            if (std::abs(off) > 0.02 * double(radius) + 1e-6 * away) REQUIRE(overlaps == (off < 0));
        }
    }
}

// A sphere of radius 0.5 with its mesh.
const Collider& ball() {
    static const Collider collider(sphereMesh(), build(sphereMesh(), {.voxelSize = voxel}),
                                   {.accuracy = ContactAccuracy::exactNearFeatures});
    return collider;
}

}  // namespace

TEST_CASE("queries with any floats end, and their answers hold") {
    const unsigned seed = test::seed();
    checkQueries(withMesh(), seed, 3000);
    checkQueries(withoutMesh(), seed, 500);
}

TEST_CASE("batches of any floats answer as single queries do") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Extremes extreme(seed);
    for (const Field* field : {&withMesh(), &withoutMesh()}) {
        std::vector<glm::vec3> points(field->mesh() ? 2000 : 200);
        for (glm::vec3& point : points) point = extreme.vector();
        std::vector<Sample> samples(points.size());
        std::vector<ClosestPoint> closest(points.size());
        field->sample(points, samples);
        field->closest(points, closest);
        for (std::size_t i = 0; i < points.size(); ++i) {
            CAPTURE(i, points[i].x, points[i].y, points[i].z);
            REQUIRE(samples[i].distance == field->sample(points[i]).distance);
            const ClosestPoint single = field->closest(points[i]);
            REQUIRE(closest[i].found == single.found);
            REQUIRE(std::abs(closest[i].distance) == Approx(std::abs(single.distance)));
        }
    }
}

TEST_CASE("rays and spheres along an axis touch from as far away as floats reach") {
    for (const Field* field : {&withMesh(), &withoutMesh()})
        for (const float far : {1e3f, 1e6f, 1e9f, 1e12f, 1e15f, 1e18f, 1e20f, 1e30f, 1e38f}) {
            CAPTURE(far, bool(field->mesh()));
            const Ray ray{{0, far, 0}, {0, -1, 0}, infinity};
            const auto hit = field->raycast(ray);
            REQUIRE(hit);
            CHECK(hit->distance == Approx(far - radius));
            CHECK(hit->position.y == Approx(radius).margin(0.01));
            CHECK(hit->normal.y > 0.9f);
            for (const float part : {1e-30f, 1e-6f, 0.1f}) {
                const auto touch = field->sphereCast(ray, part * far);
                REQUIRE(touch);
                CHECK(touch->distance == Approx(far - radius - part * far).epsilon(1e-5));
                CHECK(touch->position.y == Approx(radius).margin(0.02));
                CHECK(touch->normal.y > 0.9f);
                CHECK_FALSE(field->sphereCast({{0, far, 0}, {0, 1, 0}, infinity}, part * far));
            }
        }
}

TEST_CASE("the closest point of what is far away is on the near side, and bounds are below the truth") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Random random(seed);
    const glm::vec3 half(0.5f, 0.25f, 0.125f);
    const Mesh box = shapes::box(half, 6);
    const LevelSet boxField = build(box, {.voxelSize = 0.02f});
    const Field boxes[] = {Field(boxField, box), Field(boxField)};
    for (double away = 10; away < 2e38; away *= 3) {
        const glm::vec3 direction = random.direction(), point = float(away) * direction;
        CAPTURE(away, direction.x, direction.y, direction.z);
        const ClosestPoint onSphere = withMesh().closest(point);
        REQUIRE(onSphere.found);
        REQUIRE(onSphere.distance == Approx(away - double(radius)).epsilon(1e-6).margin(0.003));
        REQUIRE(glm::dot(onSphere.normal, direction) > 0.98f);
        REQUIRE(glm::dot(onSphere.position, direction) > radius - 0.005f);
        for (const Field& field : boxes) {
            const glm::dvec3 p(point), beyond = glm::max(glm::abs(p) - glm::dvec3(half), 0.0);
            const double truth = glm::length(beyond);
            const Sample sample = field.sample(point);
            REQUIRE_FALSE(field.inside(point));
            REQUIRE(double(sample.distance) <= truth);
            REQUIRE(double(sample.distance) >= (1 - 1e-6) * truth - 0.3);
            const ClosestPoint closest = field.closest(point);
            REQUIRE(closest.found);
            // the interpolant rounds off corners by less than a voxel
            REQUIRE(closest.distance == Approx(truth).epsilon(1e-6).margin(field.mesh() ? 1e-3 : 0.02));
            // the corner, or a point as near to 1e-3 of the size
            const double reach = glm::dot(glm::dvec3(closest.position), glm::dvec3(direction));
            REQUIRE(reach > glm::dot(glm::dvec3(half), glm::abs(glm::dvec3(direction))) - 0.02 - 1 / away);
            REQUIRE(glm::dot(closest.normal, direction) > 0);
        }
    }
}

TEST_CASE("bodies anywhere, of any size, along any path, collide or do not") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Extremes extreme(seed);
    std::vector<Contact> contacts;
    for (int i = 0; i < 300; ++i) {
        CAPTURE(i);
        const auto placed = [&]() -> Placed {
            Placed body{ball()};
            if (i % 2) body.pose.position = extreme.vector();
            if (i % 3 == 0)
                body.pose.rotation =
                    glm::normalize(glm::quat(extreme.number(), extreme.number(), extreme.number(), extreme.number()));
            if (i % 5 == 0) body.scale = std::abs(extreme.number());
            if (i % 7 == 0) body.motion = {extreme.vector(), extreme.vector()};
            return body;
        };
        const Placed a = placed(), b = placed();
        contacts.clear();
        ContactCache near;
        ContactOptions options = unfiltered(i % 4 ? voxel : extreme.number(), i % 11 == 0);
        options.reduced = i % 13 < 6;
        // of numbers too small or too large to normalise
        const auto isRefused = [](const Placed& body) { return std::abs(glm::length(body.pose.rotation) - 1) > 2e-3f; };
        if (isRefused(a) || isRefused(b)) {
            CHECK_THROWS_AS(collide(a, b, options, contacts), std::invalid_argument);
            continue;
        }
        collide(a, b, options, contacts, i % 2 ? &near : nullptr);
        collide(a, b, options, contacts, i % 2 ? &near : nullptr);
        for (const Contact& contact : contacts)
            REQUIRE((isFinite(contact.position) && isUnit(contact.normal) && std::isfinite(contact.distance) &&
                     std::isfinite(contact.approach)));
        // contacts of the same two balls lie where they overlap
        if (i % 2 == 0 && i % 3 && i % 5 && i % 7 && i % 4) REQUIRE_FALSE(contacts.empty());
    }
}

TEST_CASE("a rotation that is no unit quaternion is refused, also with a motion that no body makes") {
    const Collider samples(sphereMesh(), build(sphereMesh(), {.voxelSize = voxel}),
                           {.accuracy = ContactAccuracy::samples});
    const ContactShape box = ContactShape::box({0.2f, 0.2f, 0.2f});
    std::vector<Contact> contacts;
    for (const glm::quat& rotation : {glm::quat(0, 0, 0, 0), glm::quat(2, 0, 0, 0), glm::quat(1, 1, 1, 1),
                                      glm::quat(1e30f, 0, -1e30f, 1), glm::quat(0.99f, 0, 0, 0)}) {
        const Motion motion{{1e30f, 0, 0}, {0, 900, 0}};
        const Placed a{samples, {{0.1f, 0, 0}, rotation}, 1, motion}, b{samples};
        const PlacedShape shape{box, {{0.1f, 0, 0}, rotation}, 1, motion}, other{ContactShape(samples)};
        const auto isNamed = Catch::Matchers::Contains("must be a unit quaternion");
        CHECK_THROWS_WITH(collide(a, b, {}, contacts), isNamed);
        CHECK_THROWS_WITH(collide(b, a, {}, contacts), isNamed);
        CHECK_THROWS_WITH(collide(shape, other, {}, contacts), isNamed);
        CHECK_THROWS_WITH(distance(a, b), isNamed);
        CHECK_THROWS_WITH(distance(other, shape), isNamed);
        CHECK_THROWS_WITH(timeOfImpact(a, b), isNamed);
        CHECK_THROWS_WITH(timeOfImpact(shape, other), isNamed);
    }
    CHECK(contacts.empty());
    collide(Placed{samples, {{0.9f, 0, 0}, {1.0003f, 0, 0, 0}}}, Placed{samples}, unfiltered(voxel, false), contacts);
    CHECK_FALSE(contacts.empty());
}

TEST_CASE("distances and impacts of bodies anywhere, of any size, along any path, end") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Extremes extreme(seed);
    const ContactShape shapes[] = {ContactShape(ball()), ContactShape::box({0.2f, 0.3f, 0.4f}),
                                   ContactShape::cone(0.3f, 0.4f), ContactShape::capsule(0.2f, 0.3f)};
    for (int i = 0; i < 40; ++i) {
        CAPTURE(i);
        const auto placed = [&](const ContactShape& shape) -> PlacedShape {
            PlacedShape body{shape};
            body.pose.position = extreme.vector();
            body.pose.rotation = glm::angleAxis(float(extreme(0, 6)), glm::normalize(glm::vec3(1, 2, 3)));
            if (i % 3) body.scale = float(std::exp2(extreme(-126, 126)));
            // a body that rotates by more than a turn takes many steps
            body.motion = {extreme.vector(), {float(extreme(-6, 6)), float(extreme(-6, 6)), 0}};
            return body;
        };
        const PlacedShape a = placed(shapes[0]), b = placed(shapes[i % 4]);
        const BodyDistance away = distance(a, b);
        if (!isFinite(a.pose.position) || !isFinite(b.pose.position)) continue;
        REQUIRE_FALSE(std::isnan(away.distance));
        if (!isFinite(a.motion.displacement) || !isFinite(b.motion.displacement)) {
            CHECK_THROWS_WITH(timeOfImpact(a, b), Catch::Matchers::Contains("must be finite"));
            continue;
        }
        const Impact impact = timeOfImpact(a, b);
        if (impact.found) REQUIRE((impact.fraction >= 0 && impact.fraction <= 1));
    }
}

TEST_CASE("a body collides with triangles anywhere, of any numbers") {
    const unsigned seed = test::seed();
    CAPTURE(seed);
    Extremes extreme(seed);
    for (int i = 0; i < 300; ++i) {
        CAPTURE(i);
        const auto corner = [&] { return i % 3 ? extreme.vector() : glm::vec3(extreme(-1, 1), 0.1f, extreme(-1, 1)); };
        std::vector<Triangle> triangles{{corner(), corner(), corner()}, {corner(), corner(), corner()}};
        triangles.push_back({triangles[0][0], triangles[0][1], extreme.vector()});
        const OpenSurface sheet{[&](const Bounds&, const OpenSurface::Visitor& visitor) {
            for (std::size_t t = 0; t < triangles.size(); ++t) visitor(triangles[t], t);
        }};
        PlacedShape body{ContactShape(ball())}, ground{ContactShape::triangles(sheet)};
        if (i % 2) ground.pose.position = extreme.vector();
        if (i % 5 == 0) body.pose.position = extreme.vector();
        if (i % 7 == 0) body.motion = {extreme.vector(), extreme.vector()};
        std::vector<Contact> contacts;
        collide(body, ground, unfiltered(voxel, i % 11 == 0), contacts);
        collide(ground, body, unfiltered(voxel, i % 11 == 0), contacts);
        for (const Contact& contact : contacts) REQUIRE((isFinite(contact.position) && isUnit(contact.normal)));
        REQUIRE_FALSE(std::isnan(distance(body, ground).distance));
        body.motion = {glm::vec3(extreme(-1, 1), extreme(-1, 1), 0), glm::vec3(1, 0, 0)};
        for (const bool penetration : {false, true}) {
            const Impact impact = timeOfImpact(body, ground, {.penetration = penetration});
            if (impact.found) REQUIRE((impact.fraction >= 0 && impact.fraction <= 1));
        }
    }
}
}  // namespace bilayer::extremes_test
