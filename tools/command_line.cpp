// SPDX-License-Identifier: Apache-2.0
#include "tools/command_line.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <new>
#include <string>
#include <system_error>

#include "sdf/io/atomic_file.h"
#include "tools/output.h"

namespace {

using bilayer::tools::done, bilayer::tools::fault, bilayer::tools::usage;

// Opens closed standard streams, in modes in which reading and writing fail: else a file that is opened later would
// take their place, and receive messages.
void fillStandardStreams() {
    for (int stream = STDIN_FILENO; stream <= STDERR_FILENO; ++stream)
        if (::fcntl(stream, F_GETFD) < 0) (void)!::open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY);
}

void setSignals() {
    bilayer::detail::removeAtomicFilesOnSignal();
    // a closed pipe ends the command quietly; a file above the size limit is an ordinary error
    std::signal(SIGPIPE, SIG_DFL);
    std::signal(SIGXFSZ, SIG_IGN);
}

// Errors of devices and files may have several lines; the contract is one line.
int complain(const std::string& message) {
    constexpr const char* spaces = " \t\r\n";
    std::string line;
    for (std::size_t begin = 0, end = 0; begin < message.size(); begin = message.find_first_not_of(spaces, end)) {
        end = std::min(message.find('\n', begin), message.size());
        if (begin > 0) line += "; ";
        line += message.substr(begin, message.find_last_not_of(spaces, end) + 1 - begin);
    }
    std::fprintf(stderr, "bilayer: %s\n", bilayer::tools::printable(line).c_str());
    return fault;
}

// Returns whether a word is empty, and reports it: CLI11 2.2 takes it for the name of an option group, and never ends.
bool hasEmptyWord(int count, char** arguments) {
    for (int i = 1; i < count; ++i)
        if (*arguments[i] == '\0') {
            std::fprintf(stderr, "argument %d is empty; leave it out, or write a value\n", i);
            return true;
        }
    return false;
}

// Returns whether the first word should be a command and is none, and reports it.
bool isUnknownCommand(const CLI::App& app, const std::string& word) {
    std::string names;
    for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
        if (command->get_name() == word) return false;
        names += (names.empty() ? "" : ", ") + command->get_name();
    }
    std::fprintf(stderr, "there is no command '%s'; the commands are %s\n", bilayer::tools::printable(word).c_str(),
                 names.c_str());
    return true;
}

int flushOutput() {
    if (std::fflush(stdout) == 0 && !std::ferror(stdout)) return done;
    return complain("cannot write to standard output: " + std::generic_category().message(errno));
}

}  // namespace

void bilayer::tools::prepareProcess() {
    fillStandardStreams();
    setSignals();
}

int bilayer::tools::runCommandLine(CLI::App& app, int count, char** arguments) {
    if (hasEmptyWord(count, arguments)) return usage;
    if (count > 1 && *arguments[1] != '-' && isUnknownCommand(app, arguments[1])) return usage;
    try {
        app.parse(count, arguments);
        return flushOutput();
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? flushOutput() : usage;
    } catch (const std::bad_alloc&) {
        return complain("out of memory");
    } catch (const std::exception& error) {
        return complain(error.what());
    }
}
