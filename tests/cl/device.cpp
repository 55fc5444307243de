// SPDX-License-Identifier: Apache-2.0
// Lists devices, opens one of them, and reports missing ones.
#include <bilayer/cl/device.h>

#include <fmt/core.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <optional>

namespace bilayer::device_test {
using Catch::Matchers::Contains;

namespace {

// Sets an environment variable for its lifetime; restores it afterwards.
class Variable {
  public:
    Variable(const char* name, const char* value) : name_(name) {
        if (const char* old = std::getenv(name)) old_ = old;
        ::setenv(name, value, 1);
    }
    ~Variable() { old_ ? ::setenv(name_, old_->c_str(), 1) : ::unsetenv(name_); }

  private:
    const char* name_;
    std::optional<std::string> old_;
};

std::string uppercase(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return char(std::toupper(c)); });
    return text;
}

}  // namespace

TEST_CASE("every device says what it is") {
    const auto all = devices();
    REQUIRE_FALSE(all.empty());
    for (const DeviceInfo& info : all) {
        CHECK_FALSE(info.platform.empty());
        CHECK_FALSE(info.name.empty());
        CHECK_THAT(info.version, Contains("OpenCL"));
        CHECK_THAT(info.platformVersion, Contains("OpenCL"));
        CHECK_FALSE(info.driver.empty());
        CHECK(info.computeUnits > 0);
        CHECK(info.maxAllocationBytes > 0);
        CHECK(info.memoryBytes >= info.maxAllocationBytes);
    }
}

TEST_CASE("GPUs are listed before all others") {
    const auto all = devices();
    CHECK(std::is_partitioned(all.begin(), all.end(), [](const DeviceInfo& info) { return info.gpu; }));
}

TEST_CASE("a device opens by a part of its name or platform in any case") {
    for (const DeviceInfo& info : devices()) {
        const Device byName = openDevice(uppercase(info.name));
        CHECK(byName.info().name == info.name);
        CHECK(openDevice(uppercase(info.platform)).info().platform == info.platform);
    }
}

TEST_CASE("an unknown device is an error that lists the devices") {
    const std::string any = devices().at(0).name;
    CHECK_THROWS_AS(openDevice("abacus"), DeviceError);
    CHECK_THROWS_WITH(openDevice("abacus"), Contains("abacus") && Contains(any));
}

TEST_CASE("the environment names the device where the caller does not") {
    const std::string any = devices().at(0).name;
    const Variable variable("BILAYER_DEVICE", "abacus");
    CHECK_THROWS_WITH(openDevice(), Contains("abacus"));
    CHECK(openDevice(any).info().name == any);
}

TEST_CASE("without a driver there is no device, and opening one says so") {
    // loaders search for drivers once per process, so this test starts another process; a packed program is started by
    // bench/packed.sh
    const char* const packed = std::getenv("BILAYER_SELF");
    const std::string self =
        packed ? packed : fmt::format("'{}'", std::filesystem::read_symlink("/proc/self/exe").string());
    const std::string command = "OCL_ICD_VENDORS=/nonexistent OCL_ICD_FILENAMES= " + self + " '[child]' >/dev/null";
    CHECK(std::system(command.c_str()) == 0);
}

TEST_CASE("what the process without drivers checks", "[.child]") {
    CHECK(devices().empty());
    CHECK_THROWS_AS(openDevice(), DeviceError);
    CHECK_THROWS_WITH(openDevice("any"), Contains("no OpenCL device"));
}
}  // namespace bilayer::device_test
