// SPDX-License-Identifier: Apache-2.0
// All fuzzers in one program. The environment variable BILAYER_FUZZER names the check; other arguments are libFuzzer's.
// `fuzzer --list` prints the names and maximum sizes, `fuzzer --seeds=DIR` writes the first inputs and the dictionary.
#include <oneapi/tbb/global_control.h>
#include <pthread.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "tests/fuzz/checks.h"

namespace bilayer::test {
namespace {

const FuzzCheck& chosenCheck() {
    const char* const name = std::getenv("BILAYER_FUZZER");
    for (const FuzzCheck& check : fuzzChecks())
        if (name && std::strcmp(check.name, name) == 0) return check;
    std::fprintf(stderr, "BILAYER_FUZZER is %s; fuzzer --list prints the names\n", name ? name : "not set");
    std::exit(2);
}

std::string quoted(const std::string& word) {
    std::string text = "\"";
    for (const char c : word) {
        char escaped[5];
        std::snprintf(escaped, sizeof escaped, "\\x%02x", static_cast<unsigned char>(c));
        text += escaped;
    }
    return text + "\"\n";
}

void writeSeeds(const std::filesystem::path& folder) {
    for (const FuzzCheck& check : fuzzChecks()) {
        const std::filesystem::path here = folder / check.name;
        std::filesystem::create_directories(here);
        int number = 0;
        for (const std::string& seed : check.seeds())
            std::ofstream(here / ("seed-" + std::to_string(number++)), std::ios::binary) << seed;
        std::ofstream words(folder / (std::string(check.name) + ".dict"));
        for (const std::string& word : check.words) words << quoted(word);
    }
}

}  // namespace
}  // namespace bilayer::test

using namespace bilayer::test;

extern "C" int LLVMFuzzerInitialize(int* count, char*** arguments) {
    for (int i = 1; i < *count; ++i) {
        const std::string_view argument = (*arguments)[i];
        if (argument == "--list") {
            for (const FuzzCheck& check : fuzzChecks()) std::printf("%s %zu\n", check.name, check.maxSize);
            std::exit(0);
        }
        if (argument.starts_with("--seeds=")) {
            writeSeeds(argument.substr(argument.find('=') + 1));
            std::exit(0);
        }
    }
    // one thread: coverage depends on the input alone
    static const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, 1);
    // a process that reads a scene may end as it likes: it keeps no input, since findings are relative to this folder
    ::pthread_atfork(nullptr, nullptr, [] {
        if (::chdir("/") != 0) ::_exit(1);
    });
    chosenCheck();
    return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const FuzzCheck& check = chosenCheck();
    check.run({data, size});
    return 0;
}
