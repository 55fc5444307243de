// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/scheduler.h"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <deque>
#include <memory>
#include <optional>
#include <system_error>

#include "sdf/io/content_hash.h"
#include "tools/batch/output_locks.h"
#include "tools/batch/records.h"
#include "tools/batch/signal_watch.h"
#include "tools/batch/work_folder.h"

namespace bilayer::tools {
namespace {

namespace fs = std::filesystem;

// Time between two checks of outputs that other batches have locked, and max time between two progress lines [ms].
constexpr int lockInterval = 200, progressInterval = 500;
// A process that has used more memory converts no other mesh: it would keep a part of it.
constexpr std::uint64_t maxReusedMemory = 128 << 20;

/// A worker and the folder where it writes.
struct Workplace {
    WorkFolder folder;
    Worker worker;
};

/// A mesh that a worker converts.
struct RunningMesh {
    const BatchMesh* mesh;
    WorkerTask task;
    OutputLock lock;
    Stopwatch watch;
    std::unique_ptr<Workplace> place;
};

/// Moves what a worker has made to its place. Returns an error, or nothing.
std::string moveTo(const fs::path& from, const fs::path& to) {
    std::error_code error;
    fs::rename(from, to, error);
    if (error == std::errc::no_such_file_or_directory) {
        fs::create_directories(to.parent_path(), error);
        if (!error) fs::rename(from, to, error);
    }
    return error ? fmt::format("cannot write {}: {}", to.string(), error.message()) : "";
}

class Scheduler {
  public:
    explicit Scheduler(const BatchPlan& plan)
        : plan_(plan),
          locks_(plan.folder.locks()),
          records_(plan.folder.records(), plan.shard),
          optionsHash_(hex(detail::contentHash(plan.conversion.optionsText))) {
        for (const BatchMesh& mesh : plan.meshes) waiting_.push_back(&mesh);
        result_.counts.total = plan.meshes.size();
        removeAbandoned(plan.folder.work(), locks_);
    }

    BatchResult run() {
        for (start(); !running_.empty() || !locked_.empty(); start()) {
            wait();
            if ((result_.signal = signals_.arrived()) != 0) break;
            settleEnded();
            progress_.show(result_.counts);
        }
        return result_;
    }

  private:
    // Starts what fits next to the running workers.
    void start() {
        while (!waiting_.empty() && canStartSmall()) {
            const BatchMesh* mesh = waiting_.front();
            waiting_.pop_front();
            std::error_code absent;
            const auto size = fs::file_size(mesh->file, absent);
            // a mesh takes about as much memory as its file
            if (!absent && size > plan_.conversion.largeBytes)
                large_.push_back(mesh);
            else
                tryToStart(mesh, /*isLarge=*/false);
        }
        while (!large_.empty() && waiting_.empty() && running_.empty()) {
            const BatchMesh* mesh = large_.front();
            large_.pop_front();
            tryToStart(mesh, /*isLarge=*/true);
        }
    }

    bool canStartSmall() const {
        return running_.size() < std::size_t(plan_.threads) && (running_.empty() || !running_.front()->task.isLarge);
    }

    // Meshes that are fewer than the threads share them.
    int threadsOfSmall() const {
        const std::size_t unfinished = running_.size() + waiting_.size() + 1;
        return std::max(1, plan_.threads / int(std::min(unfinished, std::size_t(plan_.threads))));
    }

    void tryToStart(const BatchMesh* mesh, bool isLarge) {
        std::optional<OutputLock> lock = locks_.take(mesh->name);
        if (!lock) {
            locked_.push_back(mesh);
            return;
        }
        const WorkerTask task{.mesh = std::size_t(mesh - plan_.meshes.data()),
                              .threads = isLarge ? plan_.threads : threadsOfSmall(),
                              .isLarge = isLarge};
        std::unique_ptr<Workplace> place = idle_.empty() ? newWorkplace() : std::move(idle_.back());
        if (!idle_.empty()) idle_.pop_back();
        running_.push_back(
            std::unique_ptr<RunningMesh>(new RunningMesh{mesh, task, std::move(*lock), Stopwatch(), std::move(place)}));
        running_.back()->place->worker.begin(task);
    }

    std::unique_ptr<Workplace> newWorkplace() {
        const std::string name = fmt::format("{}.{}", records_.path().stem().string(), workplaceCount_++);
        const fs::path folder = plan_.folder.work() / name;
        const auto work = [this, folder](const WorkerTask& task, const Worker::Report& report) {
            return packed(convert(task, folder, [&](const Json& known) { report(packed(known)); }));
        };
        return std::unique_ptr<Workplace>(new Workplace{{folder, locks_}, {plan_.limits, work}});
    }

    static std::string packed(const Json& record) {
        return record.dump(-1, ' ', false, Json::error_handler_t::replace);
    }

    Json convert(const WorkerTask& task, const fs::path& folder, const ReportKnown& report) const {
        const BatchMesh& mesh = plan_.meshes[task.mesh];
        return tools::convert(plan_.conversion,
                              {.mesh = mesh.file,
                               .output = plan_.folder.field(mesh.name),
                               .work = folder,
                               .threads = task.threads,
                               .mayBeLarge = task.isLarge || plan_.threads == 1},
                              report);
    }

    // Waits until a worker answers, ends or is late, a signal arrives, or something is to be looked at again.
    void wait() {
        std::vector<pollfd> files{{signals_.file(), POLLIN, 0}};
        int timeout = locked_.empty() ? progressInterval : lockInterval;
        for (const auto& running : running_) {
            files.push_back({running->place->worker.socket(), POLLIN, 0});
            if (const int left = running->place->worker.millisecondsLeft(); left >= 0)
                timeout = std::min(timeout, left);
        }
        if (::poll(files.data(), files.size(), timeout) < 0 && errno != EINTR)
            throw std::system_error(errno, std::generic_category(), "poll");
        ready_.clear();
        for (std::size_t i = 1; i < files.size(); ++i) ready_.push_back(files[i].revents != 0);
        if (running_.empty()) {
            waiting_.insert(waiting_.end(), locked_.begin(), locked_.end());
            locked_.clear();
        }
    }

    void settleEnded() {
        for (std::size_t i = running_.size(); i-- > 0;) {
            Worker& worker = running_[i]->place->worker;
            const bool hasEnded = ready_[i] && !worker.read();
            if (!hasEnded && worker.millisecondsLeft() != 0) continue;
            const WorkerEnd end = worker.finish();
            Json known = knownFrom(end);
            if (hasEnded && worker.isUsed() && mayBeCausedByEarlierMeshes(end, known)) {
                tryAlone(*running_[i]);
                continue;
            }
            settle(*running_[i], end, std::move(known));
            if (!end.answer.empty() && end.peakMemory <= maxReusedMemory)
                idle_.push_back(std::move(running_[i]->place));
            running_.erase(running_.begin() + std::ptrdiff_t(i));
        }
    }

    static Json knownFrom(const WorkerEnd& end) {
        const bool hasAnswered = !end.answer.empty();
        Json known = Json::parse(hasAnswered ? end.answer : end.reported, nullptr, /*allow_exceptions=*/false);
        if (!known.is_object()) known = Json::object();
        if (!hasAnswered) known.update({{"outcome", "failed"}, {"reason", end.reason}, {"error", end.error}});
        return known;
    }

    // Whether earlier meshes in the same process may have caused the failure. The mesh is then tried in a new process.
    bool mayBeCausedByEarlierMeshes(const WorkerEnd& end, const Json& known) const {
        return end.answer.empty() || (known["outcome"] == "failed" && plan_.limits.memory > 0);
    }

    void tryAlone(RunningMesh& running) {
        running.place = newWorkplace();
        running.place->worker.begin(running.task);
    }

    void settle(const RunningMesh& running, const WorkerEnd& end, Json known) {
        const BatchMesh& mesh = *running.mesh;
        const fs::path& work = running.place->folder.path();
        std::error_code error;
        fs::rename(work / workThumbnail, plan_.folder.thumbnail(textOf(mesh.name)), error);
        if (error) fs::remove(work / workThumbnail, error);  // the next mesh may have none
        if (known["outcome"] == "done")
            if (const std::string error = moveTo(work / workField, plan_.folder.field(mesh.name)); !error.empty())
                known.update(Json{{"outcome", "failed"}, {"reason", "error"}, {"error", error}});
        if (known["outcome"] == "large") {
            large_.push_back(&mesh);
            return;
        }
        count(mesh, known);
        record(running, end, known);
    }

    void count(const BatchMesh& mesh, const Json& known) {
        BatchCounts& counts = result_.counts;
        const std::string outcome = known["outcome"];
        ++(outcome == "done" ? counts.done : outcome == "skipped" ? counts.skipped : counts.failed);
        if (outcome == "failed" && result_.firstFailure.empty())
            result_.firstFailure = fmt::format("{}: {}", mesh.name, known["error"].get<std::string>());
    }

    void record(const RunningMesh& running, const WorkerEnd& end, const Json& known) {
        Json record{{"time", timeText()},
                    {"file", textOf(running.mesh->name)},
                    {"path", textOf(running.mesh->file.string())},
                    {"output", textOf(plan_.folder.field(running.mesh->name).string())},
                    {"shard", plan_.shard.text()},
                    {"options", plan_.conversion.optionsText},
                    {"optionsHash", optionsHash_},
                    {"threads", running.task.threads},
                    {"alone", running.task.isLarge}};
        record.update(known);
        record["seconds"]["total"] = running.watch.seconds();
        record["peakBytes"] = end.peakMemory;
        const std::string line = lineOf(record);
        records_.add(line);
        if (!plan_.printsLines) return;
        fmt::print("{}", line);
        std::fflush(stdout);
    }

    const BatchPlan& plan_;
    const SignalWatch signals_;
    const OutputLocks locks_;
    RecordFile records_;
    const std::string optionsHash_;
    ProgressLine progress_;
    BatchResult result_;
    std::deque<const BatchMesh*> waiting_, large_, locked_;
    std::vector<std::unique_ptr<RunningMesh>> running_;
    std::vector<std::unique_ptr<Workplace>> idle_;
    int workplaceCount_ = 0;   // that there have been
    std::vector<bool> ready_;  // of each running mesh: whether its worker has something to read
};

}  // namespace

BatchResult runBatch(const BatchPlan& plan) {
    return Scheduler(plan).run();
}

}  // namespace bilayer::tools
