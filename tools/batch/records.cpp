// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/records.h"

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string_view>
#include <system_error>

namespace bilayer::tools {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::system_clock;

std::string hostName() {
    char name[256] = "";
    ::gethostname(name, sizeof name - 1);
    std::string text = name;
    std::replace(text.begin(), text.end(), '/', '_');
    return text;
}

long long milliseconds() {
    return std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now().time_since_epoch()).count();
}

bool isRecord(const Json& json) {
    return json.is_object() && json.contains("file") && json["file"].is_string() && json.contains("outcome") &&
           json["outcome"].is_string() && json.contains("time") && json["time"].is_string();
}

// Whether a later record says less than an earlier one: the mesh was up to date.
bool isSkipped(const Json& earlier, const Json& later) {
    const auto hashes = [](const Json& json) {
        return json.value("sourceHash", std::string()) + json.value("optionsHash", std::string());
    };
    return later["outcome"] == "skipped" && earlier["outcome"] == "done" && hashes(earlier) == hashes(later);
}

void readFile(const fs::path& path, std::vector<Json>& records, std::size_t& damagedLines) {
    std::ifstream stream(path, std::ios::binary);
    if (!stream) throw std::runtime_error(path.string() + ": cannot be read");
    for (std::string line; std::getline(stream, line);) {
        Json json = Json::parse(line, nullptr, /*allow_exceptions=*/false);
        if (isRecord(json))
            records.push_back(std::move(json));
        else
            ++damagedLines;
    }
}

}  // namespace

RecordFile::RecordFile(fs::path folder, const Shard& shard)
    : path_(std::move(folder) / fmt::format("{:06}-of-{:06}.{}.{}.{}.jsonl", shard.index, shard.count, hostName(),
                                            ::getpid(), milliseconds())) {}

RecordFile::~RecordFile() {
    if (file_ >= 0) ::close(file_);
}

void RecordFile::add(const std::string& line) {
    if (file_ < 0) file_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    for (std::string_view rest = line; !rest.empty();) {
        // a full disk may take a part of the line first
        const ssize_t written = file_ < 0 ? -1 : ::write(file_, rest.data(), rest.size());
        if (written < 0 && file_ >= 0 && errno == EINTR) continue;
        if (written < 0)
            throw std::runtime_error(
                fmt::format("cannot write {}: {}", path_.string(), std::generic_category().message(errno)));
        rest.remove_prefix(std::size_t(written));
    }
}

std::string textOf(const std::string& name) {
    try {
        (void)Json(name).dump();
        return name;
    } catch (const Json::exception&) {
    }
    std::string text;
    for (const char byte : name) {
        const auto value = static_cast<unsigned char>(byte);
        text += value < 0x80 ? std::string(1, byte) : fmt::format("\\x{:02x}", value);
    }
    return text;
}

std::string lineOf(const Json& record) {
    return record.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string timeText() {
    const long long now = milliseconds();
    return fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:03}Z", fmt::gmtime(std::time_t(now / 1000)), now % 1000);
}

RecordList readRecords(const fs::path& folder) {
    std::error_code error;
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(folder, error))
        if (entry.path().extension() == ".jsonl") files.push_back(entry.path());
    if (error) throw std::runtime_error(fmt::format("{}: holds no records of a batch", folder.string()));
    RecordList list;
    std::vector<Json> all;
    for (const fs::path& file : files) readFile(file, all, list.damagedLines);
    std::stable_sort(all.begin(), all.end(), [](const Json& a, const Json& b) { return a["time"] < b["time"]; });
    std::map<std::string, Json> last;
    for (Json& record : all) {
        const auto [at, isNew] = last.try_emplace(record["file"].get<std::string>(), record);
        if (!isNew && !isSkipped(at->second, record)) at->second = std::move(record);
    }
    for (auto& [name, record] : last) list.records.push_back(std::move(record));
    return list;
}

}  // namespace bilayer::tools
