#include "demos/shared/recording.h"

#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>

#include "demos/shared/shapes.h"
#include "tests/support/support.h"

using namespace bilayer;

namespace {

std::string textOf(const std::filesystem::path& path) {
    std::ifstream file(path);
    return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace

TEST_CASE("a recording is one file that asks the network for nothing") {
    demo::Recording recording("A </script> title");
    recording.note("bodies", "1");
    recording.addBody(recording.addMesh(shapes::sphere(0.1f, 2)), {.colour = 0xff8800});
    for (int i = 0; i < 10; ++i) recording.frame(0.1 * i, std::vector<Pose>{{{0, 0, 0.1f * float(i)}}});
    const auto path = test::scratch("ball.html");
    recording.write(path);
    const std::string html = textOf(path);
    CHECK(html.size() > 500'000);  // three.js is inside
    CHECK(html.find("OrbitControls") != std::string::npos);
    CHECK(html.find("</script> title") == std::string::npos);  // a title cannot end the script that holds it
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
