// SPDX-License-Identifier: Apache-2.0
#include "demos/shared/recording.h"

#include <catch2/catch.hpp>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "demos/shared/shapes.h"
#include "tests/support/support.h"

namespace bilayer::recording_test {
namespace {

// The data in a page.
nlohmann::json dataOf(const std::string& html) {
    const std::string start = "id=\"data\">";
    const std::size_t from = html.find(start) + start.size();
    return nlohmann::json::parse(html.substr(from, html.find("</script>", from) - from));
}

// Decodes a list of numbers as the player does: base64, each byte with seven bits of a number, lowest first.
std::vector<std::uint32_t> numbersOf(const std::string& text) {
    const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::vector<std::uint32_t> numbers;
    std::uint32_t bits = 0, number = 0;
    int count = 0, shift = 0;
    for (const char digit : text.substr(0, text.find('='))) {
        bits = bits << 6 | std::uint32_t(digits.find(digit));
        if ((count += 6) < 8) continue;
        const std::uint32_t byte = bits >> (count -= 8) & 255;
        number |= (byte & 127) << shift;
        shift += 7;
        if (byte > 127) continue;
        numbers.push_back(number);
        number = 0;
        shift = 0;
    }
    return numbers;
}

Mesh unpacked(const nlohmann::json& frame) {
    Mesh mesh;
    glm::ivec3 at(0);
    const auto steps = numbersOf(frame["points"]), corners = numbersOf(frame["triangles"]);
    for (std::size_t i = 0; i < steps.size(); i += 3) {
        glm::vec3 point;
        for (int axis = 0; axis < 3; ++axis) {
            const std::uint32_t step = steps[i + std::size_t(axis)];
            at[axis] += step & 1 ? -int(step / 2) - 1 : int(step / 2);
            point[axis] = float(frame["lower"][axis]) + float(at[axis]) / 4095 * float(frame["size"][axis]);
        }
        mesh.points.push_back(point);
    }
    std::uint32_t used = 0;
    for (std::size_t i = 0; i < corners.size(); i += 3) {
        glm::uvec3 triangle;
        for (int k = 0; k < 3; ++k) {
            const std::uint32_t back = corners[i + std::size_t(k)];
            triangle[k] = back ? used - back : used++;
        }
        mesh.triangles.push_back(triangle);
    }
    return mesh;
}

}  // namespace

TEST_CASE("a recording is one file that asks the network for nothing") {
    demo::Recording recording("A </script> title");
    recording.note("bodies", "1");
    recording.addBody(recording.addMesh(shapes::sphere(0.1f, 2)), {.colour = 0xff8800});
    for (int i = 0; i < 10; ++i) recording.frame(0.1 * i, std::vector<Pose>{{{0, 0, 0.1f * float(i)}}});
    const auto path = test::scratch("ball.html");
    recording.write(path);
    const std::string html = test::contentsOf(path);
    CHECK(html.size() > 500'000);  // three.js is included
    CHECK(html.find("OrbitControls") != std::string::npos);
    CHECK(html.find("</script> title") == std::string::npos);  // a title cannot terminate the script that holds it
    for (const char* outside : {"<script src", "<link", "import(", "@import"}) {
        CAPTURE(outside);
        CHECK(html.find(outside) == std::string::npos);
    }
}

TEST_CASE("what makes no recording is refused") {
    demo::Recording recording("x");
    const int mesh = recording.addMesh(shapes::sphere(0.1f, 2));
    CHECK_THROWS_AS(recording.addBody(mesh + 1, {}), std::invalid_argument);
    recording.addBody(mesh, {});
    CHECK_THROWS_AS(recording.frame(0, std::vector<Pose>(2)), std::invalid_argument);
    recording.frame(1, std::vector<Pose>(1));
    CHECK_THROWS_AS(recording.frame(0.5, std::vector<Pose>(1)), std::invalid_argument);
    CHECK_THROWS_WITH(recording.write("/nonexistent/x.html"), Catch::Contains("/nonexistent/x.html"));
}

TEST_CASE("surfaces that change are kept, each in its frame") {
    demo::Recording recording("x");
    CHECK(recording.addChanging({.colour = 0x336699, .opacity = 0.5f, .clear = true}) == 0);
    recording.addBody(recording.addMesh(shapes::sphere(0.1f, 1)), {});
    const std::vector<Mesh> surfaces{shapes::torusKnot(2, 3, 1, 0.3f), shapes::box({3, 1, 0.2f}, 20), Mesh{}};
    for (std::size_t i = 0; i < surfaces.size(); ++i)
        recording.frame(0.1 * double(i), std::vector<Pose>(1), std::vector<Mesh>{surfaces[i]});
    const auto path = test::scratch("changing.html");
    recording.write(path);
    const nlohmann::json body = dataOf(test::contentsOf(path)).at("changing").at(0);
    CHECK(body.at("clear") == true);
    REQUIRE(body.at("frames").size() == surfaces.size());
    for (std::size_t i = 0; i < surfaces.size(); ++i) {
        const Mesh mesh = unpacked(body["frames"][i]);
        REQUIRE(mesh.triangles.size() == surfaces[i].triangles.size());
        CHECK(mesh.points.size() == surfaces[i].points.size());
        const glm::vec3 allowed = surfaces[i].triangles.empty() ? glm::vec3(0) : bounds(surfaces[i]).size() / 8000.f;
        bool near = true;
        for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
            for (int k = 0; k < 3; ++k) {
                const glm::vec3 off =
                    glm::abs(mesh.points[mesh.triangles[t][k]] - surfaces[i].points[surfaces[i].triangles[t][k]]);
                near = near && off.x <= allowed.x && off.y <= allowed.y && off.z <= allowed.z;
            }
        CHECK(near);
    }
    // recordings without such bodies are unchanged
    demo::Recording still("y");
    still.addBody(still.addMesh(shapes::sphere(0.1f, 1)), {});
    still.frame(0, std::vector<Pose>(1));
    still.write(path);
    CHECK(!dataOf(test::contentsOf(path)).contains("changing"));
}

TEST_CASE("a frame has a surface for each body that changes") {
    demo::Recording recording("x");
    recording.addChanging({});
    const Mesh ball = shapes::sphere(1, 1);
    CHECK_THROWS_AS(recording.frame(0, {}), std::invalid_argument);
    CHECK_THROWS_AS(recording.frame(0, {}, std::vector<Mesh>(2, ball)), std::invalid_argument);
    Mesh broken = ball;
    broken.triangles[0].x = 1000;
    CHECK_THROWS_AS(recording.frame(0, {}, std::vector<Mesh>{broken}), std::invalid_argument);
    recording.frame(0, {}, std::vector<Mesh>{ball});
    CHECK_THROWS_AS(recording.addChanging({}), std::invalid_argument);
}
}  // namespace bilayer::recording_test
