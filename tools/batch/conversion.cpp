// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/conversion.h"

#include <openvdb/io/Archive.h>
#include <openvdb/io/GridDescriptor.h>
#include <tbb/global_control.h>

#include <exception>
#include <fstream>
#include <memory>
#include <new>
#include <optional>
#include <string_view>
#include <utility>

#include <bilayer/sdf/grids.h>
#include <bilayer/sdf/mesh_io.h>
#include <bilayer/sdf/vdb_io.h>
#include "sdf/base/openvdb.h"
#include "sdf/io/content_hash.h"
#include "sdf/io/mapped_file.h"
#include "sdf/io/vdb/vdb_checksum.h"
#include "sdf/leaf/build_options.h"
#include "sdf/leaf/build_size.h"
#include "tools/batch/batch_folder.h"
#include "tools/batch/thumbnail.h"
#include "tools/mesh_file.h"

namespace bilayer::tools {
namespace {

using namespace bilayer::detail;

// Metadata of a field in a batch: the hash of the mesh file, and that of the options.
constexpr const char *sourceName = "bilayer:batch_source", *optionsName = "bilayer:batch_options";

/// What a field is made from.
struct ContentKey {
    std::uint64_t source = 0, options = 0;
    bool operator==(const ContentKey&) const = default;
};

bool endsWithItsChecksum(std::string_view bytes) {
    const std::size_t line = checksumLine({}).size();
    return bytes.size() > line && bytes.ends_with(checksumLine(bytes.substr(0, bytes.size() - line)));
}

// Reads the metadata of the first grid of a file, which is the distance grid. OpenVDB's File would read all grids of a
// file without offsets.
class FirstMetadata : public openvdb::io::Archive {
  public:
    openvdb::MetaMap read(std::istream& stream) {
        readHeader(stream);
        setFormatVersion(stream);
        setLibraryVersion(stream);
        setDataCompression(stream);
        openvdb::MetaMap ofFile, ofGrid;
        ofFile.readMeta(stream);
        readGridCount(stream);
        openvdb::io::GridDescriptor().read(stream);
        readGridCompression(stream);
        ofGrid.readMeta(stream);
        return ofGrid;
    }
};

// Returns whether a file is a whole field with this key. Any other file is not: it is built anew.
bool isUpToDate(const std::filesystem::path& output, const ContentKey& key) {
    std::error_code absent;
    if (!std::filesystem::is_regular_file(output, absent)) return false;
    try {
        if (!endsWithItsChecksum(MappedFile(output).bytes())) return false;
        std::ifstream stream(output, std::ios::binary);
        const openvdb::MetaMap metadata = FirstMetadata().read(stream);
        const auto source = metadata.getMetadata<openvdb::Int64Metadata>(sourceName);
        const auto options = metadata.getMetadata<openvdb::Int64Metadata>(optionsName);
        return source && options && key == ContentKey{std::uint64_t(source->value()), std::uint64_t(options->value())};
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception&) {
        return false;
    }
}

LevelSet withKey(const LevelSet& field, const ContentKey& key) {
    const openvdb::FloatGrid::Ptr distance =
        openvdb::ConstPtrCast<openvdb::FloatGrid>(field.grids().distance)->copy();  // shares the tree
    distance->insertMeta(sourceName, openvdb::Int64Metadata(std::int64_t(key.source)));
    distance->insertMeta(optionsName, openvdb::Int64Metadata(std::int64_t(key.options)));
    auto grids = std::make_shared<Grids>(field.grids());
    grids->distance = distance;
    return LevelSet(std::move(grids));
}

double memoryOf(const Mesh& mesh, const BuildOptions& options) {
    const bool hasLayers = options.method == Method::doubleLayer;
    const float reach = hasLayers ? fillParameters(options).reach : reachOf(options, options.sign);
    return estimatedBytes(mesh, extentOf(mesh), options, reach);
}

// A picture is not worth a failure: the disk may be full, and writing the field then reports it.
void writeThumbnail(const std::filesystem::path& path, const Mesh& mesh) {
    std::ofstream(path, std::ios::binary) << pngOf(thumbnailOf(mesh));
}

// One conversion. It fills the record as it goes, so that a failure keeps what is known.
class Conversion {
  public:
    Conversion(const ConversionOptions& options, const ConversionTask& task, const ReportKnown& report, Json& record)
        : options_(options), task_(task), report_(report), build_(options.build), record_(record) {
        build_.mesh = task.mesh;
        build_.output = task.output;
        build_.options.threads = task.threads;
    }

    // Returns the outcome.
    std::string run() {
        const Stopwatch hashing;
        key_ = {meshFileHash(task_.mesh), contentHash(options_.optionsText)};
        record_["sourceHash"] = hex(key_.source);
        report_(record_);
        const bool isFinished = isUpToDate(task_.output, key_);
        hashSeconds_ = hashing.seconds();
        if (isFinished) return "skipped";
        const Stopwatch reading;
        const auto [mesh, file] = readMeshFile(task_.mesh);
        outcome_.file = file;
        outcome_.read = reading.seconds();
        validate(mesh);
        setSizes(build_, mesh);
        const double bytes = memoryOf(mesh, build_.options);
        record_["triangles"] = mesh.triangles.size();
        record_["estimatedBytes"] = std::uint64_t(bytes);
        report_(record_);
        if (!task_.mayBeLarge && bytes > double(options_.largeBytes)) return "large";
        build(mesh);
        return "done";
    }

  private:
    void build(const Mesh& mesh) {
        const Stopwatch drawing;
        writeThumbnail(task_.work / workThumbnail, mesh);
        const double drawSeconds = drawing.seconds();
        const LevelSet field = withKey(buildField(build_, mesh, outcome_), key_);
        const Stopwatch writing;
        writeVdb(task_.work / workField, field, build_.stored);
        outcome_.write = writing.seconds();
        Json known = toJson(build_, outcome_, mesh, field);
        known["meshHash"] = hex(field.meshHash());
        known["read"] = std::exchange(known["file"], nullptr);
        known["seconds"]["hash"] = hashSeconds_;
        known["seconds"]["draw"] = drawSeconds;
        for (const char* unused : {"file", "output", "peakRssBytes"}) known.erase(unused);
        record_.update(known);
    }

    const ConversionOptions& options_;
    const ConversionTask& task_;
    const ReportKnown& report_;
    BuildArguments build_;
    Json& record_;
    ContentKey key_;
    BuildOutcome outcome_;
    double hashSeconds_ = 0;
};

// Limits the threads of this process until the next call. A limit that ended with each mesh would start the threads
// that it has held back, which then look for work on the cores of other meshes.
void limitThreads(int count) {
    static std::optional<tbb::global_control> limit;
    const auto parallelism = tbb::global_control::max_allowed_parallelism;
    if (limit && tbb::global_control::active_value(parallelism) == std::size_t(count)) return;
    limit.reset();
    limit.emplace(parallelism, std::size_t(count));
}

}  // namespace

Json convert(const ConversionOptions& options, const ConversionTask& task, const ReportKnown& report) {
    limitThreads(task.threads);
    Json record;
    try {
        record["outcome"] = Conversion(options, task, report, record).run();
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception& error) {
        record["outcome"] = "failed";
        record["reason"] = "error";
        record["error"] = error.what();
    }
    return record;
}

}  // namespace bilayer::tools
