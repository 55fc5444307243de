// SPDX-License-Identifier: Apache-2.0
#include "bench/command.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <iterator>
#include <system_error>

#include "bench/measure.h"

extern char** environ;

namespace bilayer::bench {
namespace {

namespace fs = std::filesystem;

std::string contentsOf(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace

CommandResult runCommand(const std::vector<std::string>& words, const fs::path& scratch) {
    std::vector<char*> arguments;
    for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    const fs::path output = scratch / "output.txt", errors = scratch / "errors.txt";
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    constexpr int replace = O_WRONLY | O_CREAT | O_TRUNC;
    posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, output.c_str(), replace, 0600);
    posix_spawn_file_actions_addopen(&files, STDERR_FILENO, errors.c_str(), replace, 0600);
    const Stopwatch watch;
    pid_t process = 0;
    const int error = ::posix_spawnp(&process, arguments[0], &files, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&files);
    if (error) throw std::system_error(error, std::generic_category(), words[0]);
    int status = 0;
    while (::waitpid(process, &status, 0) < 0)
        if (errno != EINTR) throw std::system_error(errno, std::generic_category(), "waitpid");
    const double seconds = watch.seconds();
    return {seconds, contentsOf(output), contentsOf(errors), WIFEXITED(status) && WEXITSTATUS(status) == 0};
}

}  // namespace bilayer::bench
