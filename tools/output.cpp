// SPDX-License-Identifier: Apache-2.0
#include "tools/output.h"
#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include <bilayer/sdf/vdb_io.h>

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ostream>

#include "sdf/base/method_names.h"
#include "sdf/io/atomic_file.h"
#include "sdf/io/child_process.h"

namespace bilayer::tools {

using namespace bilayer::detail;
namespace {

constexpr int barColumns = 40;  // characters of a full bar: fits a narrow terminal with its label
constexpr const char* clearLine = "\r\033[K";

Json matrix(const glm::mat3& m) {
    return Json::array({vector(m[0]), vector(m[1]), vector(m[2])});
}

std::string text(const glm::vec3& v) {
    return fmt::format("{:.6g} {:.6g} {:.6g}", v.x, v.y, v.z);
}

// Converts a position relative to an origin to world coordinates.
Json place(const glm::vec3& v, const glm::dvec3& origin) {
    return origin == glm::dvec3(0) ? vector(v) : vector(origin + glm::dvec3(v));
}

std::string placeText(const glm::vec3& v, const glm::dvec3& origin) {
    if (origin == glm::dvec3(0)) return text(v);
    const glm::dvec3 p = origin + glm::dvec3(v);
    return fmt::format("{:.10g} {:.10g} {:.10g}", p.x, p.y, p.z);
}

void addOrigin(Table& table, const glm::dvec3& origin) {
    if (origin != glm::dvec3(0))
        table.row("origin", fmt::format("{} {} {} m: coordinates are relative to it", origin.x, origin.y, origin.z));
}

std::string describeClosedness(const MeshReport& report) {
    return fmt::format("{} ({} boundary edges in {} loops, {} non-manifold edges, {} non-manifold vertices)",
                       report.closed() ? "yes" : "no", grouped(report.boundaryEdges), grouped(report.boundaryLoops),
                       grouped(report.nonManifoldEdges), grouped(report.nonManifoldVertices));
}

std::string orientation(const MeshReport& report) {
    return fmt::format("{} ({} misoriented edges, {} inside-out components, {} triangles to be flipped)",
                       report.oriented() ? "yes" : "no", grouped(report.misorientedEdges),
                       grouped(report.insideOutComponents), grouped(report.flippedTriangles));
}

}  // namespace

std::string printable(std::string text) {
    // U+0080 to U+009F are control characters too
    constexpr unsigned char firstOfTwo = 0xc2, lastControl = 0x9f;
    for (std::size_t i = 0; i < text.size(); ++i) {
        const auto here = static_cast<unsigned char>(text[i]), next = static_cast<unsigned char>(text[i + 1]);
        if (here < ' ' || here == 0x7f) text[i] = '?';
        if (here == firstOfTwo && next >= 0x80 && next <= lastControl) text[i] = text[i + 1] = '?';
    }
    return text;
}

void Table::print() const {
    std::size_t width = 0;
    for (const auto& [label, value] : rows_) width = std::max(width, label.size());
    fmt::print("{}\n", printable(title_));
    for (const auto& [label, value] : rows_) fmt::print("  {:<{}}  {}\n", label, width, printable(value));
}

void print(const Json& json) {
    fmt::print("{}\n", json.dump(2, ' ', false, Json::error_handler_t::replace));
}

std::string grouped(std::uint64_t count) {
    std::string digits = std::to_string(count);
    for (auto at = std::ptrdiff_t(digits.size()) - 3; at > 0; at -= 3) digits.insert(std::size_t(at), ",");
    return digits;
}

std::string metres(double length) {
    return fmt::format("{:.6g} m", length);
}

std::string bytes(std::uint64_t count) {
    const double kib = double(count) / 1024;
    if (kib < 1024) return fmt::format("{:.1f} KiB", kib);
    return kib < 1024 * 1024 ? fmt::format("{:.1f} MiB", kib / 1024) : fmt::format("{:.2f} GiB", kib / (1024 * 1024));
}

std::string hex(std::uint64_t hash) {
    return fmt::format("{:016x}", hash);
}

Json number(float value) {
    return std::isfinite(value) ? Json(std::stod(fmt::format("{}", value))) : Json();
}

Json vector(const glm::vec3& v) {
    return Json::array({number(v.x), number(v.y), number(v.z)});
}

Json vector(const glm::dvec3& v) {
    return Json::array({v.x, v.y, v.z});
}

Json box(const Bounds& bounds, const glm::dvec3& origin) {
    return {{"lower", place(bounds.lower, origin)}, {"upper", place(bounds.upper, origin)}};
}

std::string boxText(const Bounds& bounds, const glm::dvec3& origin) {
    return fmt::format("{} .. {} m", placeText(bounds.lower, origin), placeText(bounds.upper, origin));
}

Json toJson(const MeshReport& report, float wall) {
    return {{"verdict", verdict(report)},
            {"points", report.points},
            {"triangles", report.triangles},
            {"components", report.components},
            {"bounds", box(report.bounds, report.origin)},
            {"origin", vector(report.origin)},
            {"closed", report.closed()},
            {"oriented", report.oriented()},
            {"boundaryEdges", report.boundaryEdges},
            {"boundaryLoops", report.boundaryLoops},
            {"nonManifoldEdges", report.nonManifoldEdges},
            {"nonManifoldVertices", report.nonManifoldVertices},
            {"misorientedEdges", report.misorientedEdges},
            {"degenerateTriangles", report.degenerateTriangles},
            {"duplicateTriangles", report.duplicateTriangles},
            {"insideOutComponents", report.insideOutComponents},
            {"flippedTriangles", report.flippedTriangles},
            {"selfIntersections", report.selfIntersections},
            {"wall", number(wall)},
            {"thinWalls", report.thinWalls},
            {"thinnestWall", number(report.thinnestWall)},
            {"commonWall", number(report.commonWall)},
            {"area", report.area},
            {"volume", report.volume}};
}

void addRows(Table& table, const MeshReport& report, float wall) {
    table.row("verdict", verdict(report));
    table.row("points", grouped(report.points));
    table.row("triangles", grouped(report.triangles));
    table.row("components", grouped(report.components));
    table.row("bounds", boxText(report.bounds, report.origin));
    addOrigin(table, report.origin);
    table.row("closed", describeClosedness(report));
    table.row("oriented", orientation(report));
    table.row("self-intersections", fmt::format("{} pairs of triangles", grouped(report.selfIntersections)));
    table.row("degenerate triangles", grouped(report.degenerateTriangles));
    table.row("duplicate triangles", grouped(report.duplicateTriangles));
    if (report.thinnestWall > 0)
        table.row("thinnest wall", fmt::format("{}; at least {} behind 99 % of the area", metres(report.thinnestWall),
                                               metres(report.commonWall)));
    if (wall > 0)
        table.row("thin walls", fmt::format("{} triangles, below {}", grouped(report.thinWalls), metres(wall)));
    table.row("area", fmt::format("{:.6g} m^2", report.area));
    if (report.closed()) table.row("volume", fmt::format("{:.6g} m^3", report.volume));
}

Json toJson(const Mesh& mesh, bool balanced) {
    return {{"points", mesh.points.size()},
            {"triangles", mesh.triangles.size()},
            {"bounds", box(bounds(mesh), mesh.origin)},
            {"origin", vector(mesh.origin)},
            {"balanced", balanced}};
}

void addRows(Table& table, const Mesh& mesh, bool balanced) {
    table.row("points", grouped(mesh.points.size()));
    table.row("triangles", grouped(mesh.triangles.size()));
    table.row("bounds", boxText(bounds(mesh), mesh.origin));
    addOrigin(table, mesh.origin);
    table.row("edges", balanced ? "balanced: each is used equally often in both directions"
                                : "not balanced: the mesh is open or not oriented (--report shows where)");
}

Json toJson(const ReadReport& read) {
    return {{"vertices", read.vertices},
            {"faces", read.faces},
            {"mergedVertices", read.mergedVertices},
            {"unusedVertices", read.unusedVertices},
            {"collapsedTriangles", read.collapsedTriangles},
            {"notes", read.notes}};
}

void addRows(Table& table, const ReadReport& read) {
    const auto counted = [](std::size_t count, const char* one, const char* many) {
        return fmt::format("{} {}", grouped(count), count == 1 ? one : many);
    };
    table.row("file", fmt::format("{}, {}", counted(read.vertices, "vertex", "vertices"),
                                  counted(read.faces, "face", "faces")));
    if (read.mergedVertices)
        table.row("merged", counted(read.mergedVertices, "vertex at the position of another",
                                    "vertices at the positions of others"));
    if (read.unusedVertices)
        table.row("left out", counted(read.unusedVertices, "vertex that no face uses", "vertices that no face uses"));
    if (read.collapsedTriangles)
        table.row("left out", counted(read.collapsedTriangles, "triangle with two coincident corners",
                                      "triangles with two coincident corners"));
    for (const std::string& note : read.notes) table.row("note", note);
}

void addRows(Table& table, const LevelSet& levelSet, const VdbOptions& stored) {
    const double size = levelSet.voxelSize();
    table.row("voxel size", metres(size));
    table.row("band", fmt::format("{:.6g} voxels outside, {:.6g} inside", levelSet.exteriorWidth() / size,
                                  levelSet.interiorWidth() / size));
    table.row("active voxels", grouped(levelSet.activeVoxels()));
    table.row("leaves", grouped(levelSet.leaves()));
    table.row("memory", bytes(levelSet.memoryBytes()));
    if (!levelSet.method().empty()) table.row("method", levelSet.method());
    if (const float bound = storedErrorBound(levelSet, stored); std::isfinite(bound))
        table.row("error bound", fmt::format("{}, {:.4g} voxels", metres(bound), bound / size));
    if (levelSet.sign().empty()) return;
    table.row("sign", fmt::format("{}: {}", levelSet.sign(), levelSet.signReason()));
    if (levelSet.sign() == nameOf(Sign::normals))
        table.row("sign conflicts", fmt::format("{} pairs of neighbours", grouped(levelSet.signConflicts())));
    if (levelSet.signUndecided() > 0 && levelSet.sign() == layerSigns)
        table.row("sign undecided",
                  fmt::format("{} voxels are as near to one layer as to the other", grouped(levelSet.signUndecided())));
}

Json provenance(const LevelSet& levelSet, const VdbOptions& stored) {
    return {{"method", levelSet.method()},
            {"sign", levelSet.sign()},
            {"signReason", levelSet.signReason()},
            {"signConflicts", levelSet.signConflicts()},
            {"signUndecided", levelSet.signUndecided()},
            {"errorBound", number(storedErrorBound(levelSet, stored))}};
}

Json toJson(const std::optional<MassProperties>& mass, const glm::dvec3& origin) {
    if (!mass) return {};
    const glm::quat& q = mass->principalAxes;
    return {{"volume", mass->volume},
            {"centre", place(mass->centre, origin)},
            {"inertia", matrix(mass->inertia)},
            {"principalInertia", vector(mass->principalInertia)},
            {"principalAxes", Json::array({number(q.w), number(q.x), number(q.y), number(q.z)})}};
}

void addRows(Table& table, const std::optional<MassProperties>& mass, const glm::dvec3& origin) {
    if (!mass) return;
    const glm::mat3 &inertia = mass->inertia, axes = glm::mat3_cast(mass->principalAxes);
    table.row("centre of mass", placeText(mass->centre, origin) + " m");
    table.row("inertia", fmt::format("xx yy zz {:.6g} {:.6g} {:.6g}, xy xz yz {:.6g} {:.6g} {:.6g} m^5", inertia[0][0],
                                     inertia[1][1], inertia[2][2], inertia[0][1], inertia[0][2], inertia[1][2]));
    for (int i = 0; i < 3; ++i)
        table.row(fmt::format("principal axis {}", i + 1),
                  fmt::format("{}: {:.6g} m^5", text(axes[i]), mass->principalInertia[i]));
}

Json toJson(const Body& body, const glm::dvec3& origin) {
    return {{"points", body.points.points().size()},
            {"margin", number(body.margin)},
            {"bounds", box(body.bounds, origin)},
            {"mass", toJson(body.mass, origin)},
            {"triangles", body.mesh ? body.mesh->triangles.size() : 0},
            {"contacts", nameOf(body.accuracy)}};
}

void addRows(Table& table, const Body& body) {
    const std::string mesh = body.mesh ? grouped(body.mesh->triangles.size()) + " triangles" : "no mesh";
    table.row("body",
              fmt::format("{} surface points, margin {}, {}, contacts {}{}", grouped(body.points.points().size()),
                          metres(body.margin), mesh, nameOf(body.accuracy), body.mass ? "" : ", without a mass"));
}

ProgressBar::ProgressBar(std::string label) : label_(std::move(label)), visible_(::isatty(STDERR_FILENO)) {}

ProgressBar::~ProgressBar() {
    if (drawn_ >= 0) fmt::print(stderr, "{}", clearLine);
}

std::function<bool(float)> ProgressBar::callback() {
    if (!visible_) return {};
    return [this](float part) {
        draw(part);
        return true;
    };
}

void ProgressBar::draw(float part) {
    const int percent = int(100 * std::clamp(part, 0.0f, 1.0f));
    if (percent == drawn_) return;
    drawn_ = percent;
    const std::size_t full = std::size_t(barColumns * percent / 100);
    const std::string bar = std::string(full, '#') + std::string(barColumns - full, '.');
    fmt::print(stderr, "{}{} [{}] {:3} %", clearLine, label_, bar, percent);
    std::fflush(stderr);
}

void requireWritable(const std::filesystem::path& path) {
    const AtomicFile probe(path);
}

void writeText(const std::filesystem::path& path, const std::string& text) {
    writeWhole(path, [&](std::ostream& stream) { stream << text; });
}

std::uint64_t peakMemory() {
    rusage usage = {};
    ::getrusage(RUSAGE_SELF, &usage);
    return std::max(std::uint64_t(usage.ru_maxrss) * 1024, detail::ChildProcess::peakMemory());
}

}  // namespace bilayer::tools
