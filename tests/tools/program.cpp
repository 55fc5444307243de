// SPDX-License-Identifier: Apache-2.0
#include "tests/tools/program.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include <bilayer/sdf/mesh_io.h>
#include "demos/shared/shapes.h"
#include "tests/support/support.h"

namespace bilayer::test {
namespace {

void redirect(const std::string& path, int flags, int target) {
    const int file = ::open(path.c_str(), flags, 0600);
    if (file < 0 || ::dup2(file, target) < 0) ::_exit(126);
    ::close(file);
}

pid_t launch(const Words& arguments, const Surroundings& s, const std::string& in, const std::string& out,
             const std::string& err) {
    std::vector<char*> words{const_cast<char*>(BILAYER_PROGRAM)};
    for (const std::string& word : arguments) words.push_back(const_cast<char*>(word.c_str()));
    words.push_back(nullptr);
    const pid_t process = ::fork();
    if (process < 0) throw std::runtime_error("fork failed");
    if (process > 0) return process;
    redirect(in, O_RDONLY, STDIN_FILENO);
    redirect(out, O_WRONLY | O_CREAT | O_TRUNC, STDOUT_FILENO);
    redirect(err, O_WRONLY | O_CREAT | O_TRUNC, STDERR_FILENO);
    for (const std::string& variable : s.variables) ::putenv(const_cast<char*>(variable.c_str()));
    if (s.fileSizeLimit >= 0) {
        const rlimit limit{rlim_t(s.fileSizeLimit), rlim_t(s.fileSizeLimit)};
        ::setrlimit(RLIMIT_FSIZE, &limit);
    }
    if (s.memoryLimit >= 0) {
        const rlimit limit{rlim_t(s.memoryLimit), rlim_t(s.memoryLimit)};
        ::setrlimit(RLIMIT_AS, &limit);
    }
    if (s.maxSeconds >= 0) {
        const rlimit limit{rlim_t(s.maxSeconds), rlim_t(s.maxSeconds)};
        ::setrlimit(RLIMIT_CPU, &limit);
    }
    if (!s.folder.empty() && ::chdir(s.folder.c_str()) != 0) ::_exit(126);
    for (const int stream : s.closed) ::close(stream);
    ::execv(words[0], words.data());
    ::_exit(127);
}

int statusOf(int waited) {
    return WIFSIGNALED(waited) ? 128 + WTERMSIG(waited) : WEXITSTATUS(waited);
}

}  // namespace

std::string contents(const std::filesystem::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
}

std::size_t Result::errorLines() const {
    return std::size_t(std::count(err.begin(), err.end(), '\n'));
}

Result run(const Words& arguments, const Surroundings& surroundings) {
    const std::string in =
        surroundings.inputPath.empty() ? textFile("stdin", surroundings.input).string() : surroundings.inputPath;
    const std::string out = surroundings.output.empty() ? scratch("stdout").string() : surroundings.output;
    const std::string err = scratch("stderr").string();
    Result result;
    rusage usage{};
    int status = 0;
    ::wait4(launch(arguments, surroundings, in, out, err), &status, 0, &usage);
    result.status = statusOf(status);
    result.peakMemory = std::size_t(usage.ru_maxrss) * 1024;
    if (surroundings.output.empty()) result.out = contents(out);
    result.err = contents(err);
    return result;
}

pid_t start(const Words& arguments) {
    return launch(arguments, {}, "/dev/null", "/dev/null", "/dev/null");
}

int wait(pid_t process) {
    int status = 0;
    ::waitpid(process, &status, 0);
    return statusOf(status);
}

Words joined(Words words, const Words& more) {
    words.insert(words.end(), more.begin(), more.end());
    return words;
}

nlohmann::json built(const Words& words) {
    const Result r = run(words);
    INFO(r.err);
    REQUIRE(r.status == 0);
    CHECK(r.err.empty());
    return r.json();
}

std::filesystem::path sphereFile(const std::string& name, int levels) {
    const std::filesystem::path path = scratch(name);
    if (!std::filesystem::exists(path)) writeMesh(path, shapes::sphere(0.5f, levels));
    return path;
}

std::string fieldFile() {
    const std::string path = scratch("sphere.vdb").string();
    if (!std::filesystem::exists(path)) {
        const Result r = run({"build", sphereFile().string(), "-o", path, "--voxel-size", "0.05"});
        INFO(r.err);
        REQUIRE(r.status == 0);
    }
    return path;
}

nlohmann::json buildSphere(const std::string& output, const Words& options) {
    return built(joined({"build", sphereFile().string(), "-o", output, "--json"}, options));
}

std::string rejectedOutput() {
    return scratch("refused.vdb").string();
}

Words rejectedBuild(const std::filesystem::path& mesh, Words options) {
    return joined({"build", mesh.string(), "-o", rejectedOutput()}, options);
}

std::filesystem::path textFile(const std::string& name, const std::string& text) {
    const std::filesystem::path path = scratch(name);
    std::ofstream(path, std::ios::binary) << text;
    return path;
}

}  // namespace bilayer::test
