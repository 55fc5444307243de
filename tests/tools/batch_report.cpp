// SPDX-License-Identifier: Apache-2.0
// `bilayer batch --report`.
#include <catch2/catch.hpp>
#include <fstream>

#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "tests/support/support.h"
#include "tests/tools/library.h"
#include "tests/tools/program.h"

namespace bilayer::batch_report_test {
using namespace bilayer::test;

namespace fs = std::filesystem;

namespace {

// Boxes, a file that is no mesh and has characters that mean something in HTML, and an open box.
fs::path reportedLibrary() {
    const fs::path library = boxLibrary("reported", 6);
    std::ofstream(library / "<b>&.obj") << "no mesh\n";
    Mesh open = shapes::box({0.5f, 0.5f, 0.5f}, 2);
    open.triangles.resize(open.triangles.size() - 8);
    writeMesh(library / "open.ply", open);
    return library;
}

std::size_t countOf(const std::string& text, const std::string& part) {
    std::size_t count = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
    return count;
}

}  // namespace

TEST_CASE("the report joins the records of all shards") {
    const fs::path library = reportedLibrary(), output = emptyFolder("report");
    int failures = 0;
    for (const char* shard : {"1/3", "2/3", "3/3"})
        failures += run(batchWords(library, output, {"--shard", shard})).status == 1;
    CHECK(failures == 1);
    // a second time all is skipped, and keeps its record
    run(batchWords(library, output));

    const auto json = run({"batch", "--report", output.string(), "--json"}).json();
    CHECK(json["meshes"] == 8);
    CHECK(json["done"] == 7);
    CHECK(json["skipped"] == 0);
    CHECK(json["failed"] == 1);
    CHECK(json["failures"] == nlohmann::json{{"error", 1}});
    CHECK(json["signs"]["normals: closed and oriented"] == 6);
    CHECK(json["damagedLines"] == 0);
    CHECK(json["lookAt"][0]["file"] == "<b>&.obj");
    for (const char* title : {"triangles", "active voxels", "seconds", "peak memory [bytes]"}) {
        std::size_t sum = 0;
        for (const auto& bin : json["histograms"][title]) {
            sum += bin["count"].get<std::size_t>();
            CHECK(bin["lower"].get<double>() < bin["upper"].get<double>());
        }
        CAPTURE(title);
        CHECK(sum == 7);
    }
    const auto triangles = json["histograms"]["triangles"];
    CHECK(triangles.size() == 1);
    CHECK(triangles[0]["lower"] == 30);
    CHECK(triangles[0]["upper"] == 100);

    const Result text = run({"batch", "--report", output.string()});
    CHECK(text.status == 0);
    CHECK(text.out.find("to look at\n  <b>&.obj: error: ") != std::string::npos);
    CHECK(text.out.find("30 .. 100") != std::string::npos);

    const std::string page = contents(output / "report.html");
    CHECK(page.find("&lt;b&gt;&amp;.obj") != std::string::npos);
    CHECK(page.find("<b>&.obj") == std::string::npos);
    CHECK(countOf(page, "<img ") >= 7);
    CHECK(countOf(page, "src=\"data:image/png;base64,iVBORw0KGgo") == countOf(page, "<img "));
    CHECK(page.find("http") == std::string::npos);
    CHECK(page.ends_with("</html>\n"));
}

TEST_CASE("a thumbnail shows the mesh") {
    const fs::path library = boxLibrary("pictures", 1), output = emptyFolder("picture_fields");
    REQUIRE(run(batchWords(library, output)).status == 0);
    std::vector<fs::path> pictures;
    for (const auto& entry : fs::directory_iterator(output / ".bilayer/thumbnails")) pictures.push_back(entry.path());
    REQUIRE(pictures.size() == 1);
    const std::string png = contents(pictures[0]);
    CHECK(png.rfind("\x89PNG\r\n\x1a\n", 0) == 0);
    CHECK(png.size() > 300);  // an empty picture of this size takes about 100 bytes
    CHECK(png.size() < 8000);
}

TEST_CASE("meshes whose names are no UTF-8 have their own records and thumbnails") {
    const fs::path library = emptyFolder("names"), output = emptyFolder("name_fields");
    for (const char* name : {"a\xff.ply", "a\xfe.ply", "\xc3\xa4.ply"})
        writeMesh(library / name, shapes::box({1, 1, 1}));
    const auto records = recordsIn(run(batchWords(library, output)).out);
    CHECK(records.size() == 3);
    CHECK(records.count("a\\xff.ply") == 1);
    CHECK(records.count("a\\xfe.ply") == 1);
    CHECK(records.count("\xc3\xa4.ply") == 1);
    const auto json = run({"batch", "--report", output.string(), "--json"}).json();
    CHECK(json["done"] == 3);
    CHECK(countOf(contents(output / "report.html"), "src=\"data:image/png;base64,") == 3);
}

TEST_CASE("damaged records are counted, and missing ones are an error") {
    const fs::path library = boxLibrary("library", 3), output = emptyFolder("damaged");
    REQUIRE(run(batchWords(library, output)).status == 0);
    std::ofstream(output / ".bilayer/records/cut.jsonl") << "{\"time\": \"2024-01-0\n[]\n{\"file\": 3}\n";
    const auto json = run({"batch", "--report", output.string(), "--json"}).json();
    CHECK(json["damagedLines"] == 3);
    CHECK(json["done"] == 3);
    const Result none = run({"batch", "--report", scratch("nothing").string()});
    CHECK(none.status == 1);
    CHECK(none.errorLines() == 1);
    CHECK(none.err.find("nothing") != std::string::npos);
}
}  // namespace bilayer::batch_report_test
