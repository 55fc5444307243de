// SPDX-License-Identifier: Apache-2.0
#include "sdf/io/child_process.h"

#include <fcntl.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <tbb/parallel_for.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cerrno>
#include <filesystem>
#include <iterator>
#include <memory>
#include <numeric>
#include <string>
#include <thread>
#include <vector>

#include "sdf/io/scenes/polygon_record.h"
#include "sdf/io/scenes/scene_io.h"
#include "tests/support/gltf.h"
#include "tests/support/polygons.h"
#include "tests/support/support.h"

namespace bilayer::child_process_test {
using namespace bilayer::detail;
using namespace std::chrono_literals;

namespace {

constexpr ChildLimits ample{60s, std::size_t(1) << 30};

// The error message for failed work
std::string failureOf(const ChildProcess::Work& work, const ChildLimits& limits = ample) {
    try {
        ChildProcess child(limits, work);
        char byte = 0;
        child.receive(&byte, 1);
    } catch (const ChildFailure& failure) {
        return failure.what();
    }
    return "an answer";
}

std::size_t openFiles() {
    const std::filesystem::directory_iterator files("/proc/self/fd");
    return std::size_t(std::distance(begin(files), end(files)));
}

bool hasNoChildren() {
    return ::waitpid(-1, nullptr, WNOHANG) < 0 && errno == ECHILD;
}

// Sets a signal's disposition for its lifetime
class Handler {
  public:
    Handler(int signal, void (*handler)(int)) : signal_(signal), before_(::signal(signal, handler)) {}
    ~Handler() { ::signal(signal_, before_); }

  private:
    int signal_;
    void (*before_)(int);
};

void reapAll(int) {
    const int error = errno;
    while (::waitpid(-1, nullptr, WNOHANG) > 0) {
    }
    errno = error;
}

Polygons receivedFrom(ChildProcess& child, std::size_t byteLimit = std::size_t(1) << 30) {
    return receivePolygons([&](void* bytes, std::size_t count) { child.receive(bytes, count); }, byteLimit);
}

Polygons throughPipe(const Polygons& polygons) {
    ChildProcess child(ample, [&](const ChildProcess::Send& send) { sendPolygons(send, polygons); });
    return receivedFrom(child);
}

}  // namespace

TEST_CASE("a child process answers at any length") {
    std::vector<int> numbers(5'000'000);
    std::iota(numbers.begin(), numbers.end(), 0);
    ChildProcess child(ample, [&](const ChildProcess::Send& send) { send(numbers.data(), numbers.size() * 4); });
    std::vector<int> received(numbers.size());
    child.receive(received.data(), received.size() * 4);
    CHECK(received == numbers);
    char more = 0;
    CHECK_THROWS_AS(child.receive(&more, 1), ChildFailure);
}

TEST_CASE("a child process that fails is an error") {
    const std::size_t files = openFiles();
    for (const int number : {SIGSEGV, SIGABRT, SIGBUS, SIGFPE, SIGKILL, SIGTERM})
        CHECK_THAT(failureOf([&](const auto&) { ::raise(number); }),
                   Catch::Contains("signal " + std::to_string(number) + " "));
    CHECK(failureOf([](const auto&) {}) == "ended without an answer");
    CHECK(failureOf([](const auto&) { throw 1; }) == "ended without an answer");
    CHECK(failureOf([](const auto&) { ::_exit(0); }) == "ended without an answer");
    CHECK(failureOf([](const auto&) { ::pause(); }, {300ms, 0}) == "took longer than 0.3 s");
    // a partial answer does not extend the time limit
    const auto drips = [](const ChildProcess::Send& send) {
        for (;; ::usleep(10000)) send("x", 1);
    };
    ChildProcess child({300ms, 0}, drips);
    std::string much(1000000, ' ');
    CHECK_THROWS_WITH(child.receive(much.data(), much.size()), "took longer than 0.3 s");
    {
        const ChildProcess abandoned(ample, [](const auto&) { ::pause(); });
    }
    CHECK(openFiles() == files + 1);  // that of `child`
}

TEST_CASE("a child process has no more memory than it is given") {
    constexpr std::size_t megabyte = 1 << 20, limit = 100;
    ChildProcess greedy({60s, limit * megabyte}, [](const ChildProcess::Send& send) {
        std::size_t count = 0;
        while (::mmap(nullptr, megabyte, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) != MAP_FAILED) ++count;
        send(&count, sizeof count);
    });
    std::size_t megabytes = 0;
    greedy.receive(&megabytes, sizeof megabytes);
    CHECK(megabytes <= limit);
    CHECK(megabytes >= limit / 2);
}

TEST_CASE("a child process leaves nothing behind and takes nothing with it") {
    {
        std::string ours = test::scratch("buffered").string();
        FILE* stream = ::fopen(ours.c_str(), "w");
        REQUIRE(stream);
        ::fputs("once", stream);
        static bool left = false;
        ::atexit([] { left = true; });
        ChildProcess child(ample, [](const ChildProcess::Send& send) {
            // no file but the pipe, and standard streams to /dev/null
            const std::size_t found = openFiles();
            send(&found, sizeof found);
            ::puts("unheard");
            ::exit(0);  // like a library that aborts
        });
        std::size_t found = 0;
        child.receive(&found, sizeof found);
        CHECK(found == 3 + 1 + 1);  // the pipe, and the folder that is being listed
        char more = 0;
        CHECK_THROWS_AS(child.receive(&more, 1), ChildFailure);
        CHECK_FALSE(left);
        ::fclose(stream);
    }
    CHECK(hasNoChildren());
}

TEST_CASE("a caller may ignore or collect its children, and may handle signals") {
    const auto segfault = [](const auto&) { ::raise(SIGSEGV); };
    const auto answer = [](const ChildProcess::Send& send) { send("x", 1); };
    for (const auto handler : {SIG_IGN, &reapAll}) {
        const Handler children(SIGCHLD, handler);
        for (int i = 0; i < 20; ++i) {
            CHECK(failureOf(answer) == "an answer");
            CHECK_FALSE(failureOf(segfault) == "an answer");
            CHECK(failureOf([](const auto&) { ::pause(); }, {20ms, 0}) == "took longer than 0.02 s");
        }
    }
    {
        const Handler own(SIGSEGV, [](int) { ::_exit(3); });
        CHECK_THAT(failureOf(segfault), Catch::Contains("signal 11 "));
    }
    sigset_t blocked, before;
    sigemptyset(&blocked);
    sigaddset(&blocked, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &blocked, &before);
    CHECK_THAT(failureOf([](const auto&) { ::raise(SIGTERM); }), Catch::Contains("signal 15 "));
    sigset_t now;
    pthread_sigmask(SIG_SETMASK, &before, &now);
    CHECK(sigismember(&now, SIGTERM) == 1);
    CHECK(sigismember(&now, SIGINT) == 0);
    CHECK(hasNoChildren());
}

TEST_CASE("a child process answers where the caller has no standard streams") {
    // in a child process: this test needs its own
    ChildProcess outer(ample, [](const ChildProcess::Send& send) {
        for (int stream = 0; stream < 3; ++stream) ::close(stream);
        ChildProcess inner(ample, [](const ChildProcess::Send& sendInner) { sendInner("inner", 5); });
        std::string text(5, ' ');
        inner.receive(text.data(), 5);
        send(text.data(), 5);
    });
    std::string text(5, ' ');
    outer.receive(text.data(), 5);
    CHECK(text == "inner");
}

TEST_CASE("child processes start while other threads are busy") {
    if (test::isSanitized()) return;
    test::Gltf gltf = test::Gltf::cube();
    const auto path = gltf.write("busy.gltf");
    std::atomic<bool> stop = false;
    std::thread busy([&] {
        while (!stop)
            tbb::parallel_for(0, 100, [](int i) { std::vector<std::string>(100, std::string(std::size_t(i), 'x')); });
    });
    std::atomic<int> right = 0;
    std::vector<std::thread> readers;
    for (int t = 0; t < 4; ++t)
        readers.emplace_back([&] {
            for (int i = 0; i < 25; ++i) right += test::volume(readScene(path)) == 8;
        });
    for (std::thread& reader : readers) reader.join();
    stop = true;
    busy.join();
    CHECK(right == 100);
    CHECK(hasNoChildren());
}

TEST_CASE("child processes start while other threads register exit handlers") {
    if (test::isSanitized()) return;
    std::atomic<bool> stop = false;
    // with pauses: a large process forks so slowly that each fork would meet a handler
    std::thread registering([&] {
        for (int burst = 0; burst < 20; ++burst) {
            for (int i = 0; i < 100; ++i) {
                std::at_quick_exit([] {});
                std::this_thread::sleep_for(100us);
            }
            std::this_thread::sleep_for(50ms);
        }
        stop = true;
    });
    const auto answer = [](const ChildProcess::Send& send) {
        std::at_quick_exit([] {});
        send("x", 1);
    };
    while (!stop) CHECK(failureOf(answer) == "an answer");
    registering.join();
    CHECK(hasNoChildren());
}

TEST_CASE("polygons arrive as they were sent, or not at all") {
    Polygons sent{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 1e300}}, {0, 1, 2, 3, 0, 2, 3}, {4, 3}, {"a note", ""}};
    const Polygons received = throughPipe(sent);
    CHECK(received.points == sent.points);
    CHECK(received.corners == sent.corners);
    CHECK(received.sizes == sent.sizes);
    CHECK(received.notes == sent.notes);
    CHECK(throughPipe({}).corners.empty());
    for (const auto& [corners, sizes] : {std::pair(std::vector<unsigned>{0, 1, 4}, std::vector<unsigned>{}),
                                         {{0, 1}, {}},
                                         {{0, 1}, {2}},
                                         {{0, 1, 2}, {4}},
                                         {{0, 1, 2, 3}, {3}},
                                         {{0, 1, 2}, {3, 0}},
                                         {{0, 1, 2, 0, 1, 2}, {3, 4294967295u, 4}}}) {
        sent.corners = corners;
        sent.sizes = sizes;
        CHECK_THROWS_AS(throughPipe(sent), ChildFailure);
    }
    ChildProcess boastful(ample, [](const ChildProcess::Send& send) {
        const std::uint64_t header[]{0, std::uint64_t(1) << 60, 0, 0, 0};
        send(header, sizeof header);
    });
    CHECK_THROWS_AS(receivedFrom(boastful), ChildFailure);
    sent.corners = {0, 1, 2};
    sent.sizes = {3};
    ChildProcess larger(ample, [&](const ChildProcess::Send& send) { sendPolygons(send, sent); });
    CHECK_THROWS_AS(receivedFrom(larger, sent.points.size() * sizeof(glm::dvec3)), ChildFailure);
    ChildProcess complaining(ample, [](const ChildProcess::Send& send) { sendError(send, "no"); });
    CHECK_THROWS_WITH(receivedFrom(complaining, 1000), "no");
    ChildProcess garbled(ample, [](const ChildProcess::Send& send) { sendError(send, "\x1b[2Jno\nway\n"); });
    CHECK_THROWS_WITH(receivedFrom(garbled), " [2Jno way");
}
}  // namespace bilayer::child_process_test
