#include "base/system/processors.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <optional>
#include <string>

#include "scratch_directory.h"

namespace tomofield::base {
namespace {

namespace fs = std::filesystem;
using testing::ScratchDirectory;

// Stands for the root of a file system that has the files of control groups.
class FakeRoot {
 public:
  explicit FakeRoot(const std::string& groups_of_process) {
    write("proc/self/cgroup", groups_of_process);
  }
  FakeRoot& write(const fs::path& file, const std::string& text) {
    fs::create_directories(directory_.path() / file.parent_path());
    directory_.write(file.string(), text);
    return *this;
  }
  FakeRoot& limit(const std::string& group, const std::string& text) {
    return write(fs::path("sys/fs/cgroup") / group / "cpu.max", text);
  }
  FakeRoot& limit_v1(const std::string& group, int quota_us, int period_us) {
    const fs::path folder = fs::path("sys/fs/cgroup/cpu") / group;
    write(folder / "cpu.cfs_quota_us", std::to_string(quota_us) + "\n");
    return write(folder / "cpu.cfs_period_us", std::to_string(period_us) + "\n");
  }
  std::optional<double> quota() const { return processors_of_this_process(path()).quota; }
  const fs::path& path() const { return directory_.path(); }

 private:
  ScratchDirectory directory_;
};

TEST(Processors, SystemWithoutControlGroupsSetsNoQuota) {
  const ScratchDirectory empty;
  const Processors found = processors_of_this_process(empty.path());
  EXPECT_FALSE(found.quota);
  EXPECT_GE(found.online, found.allowed);
  EXPECT_GE(found.allowed, 1);
  EXPECT_EQ(found.usable(), found.allowed);
}

TEST(Processors, QuotaOfVersion2IsQuotaOverPeriod) {
  FakeRoot root("0::/user.slice/run.scope\n");
  EXPECT_EQ(root.quota(), std::nullopt);
  EXPECT_EQ(root.limit("user.slice/run.scope", "max 100000\n").quota(), std::nullopt);
  EXPECT_EQ(root.limit("user.slice/run.scope", "150000 100000\n").quota(), 1.5);
  EXPECT_EQ(root.limit("user.slice/run.scope", "25000 50000\n").quota(), 0.5);
}

TEST(Processors, QuotaOfVersion1IsQuotaOverPeriod) {
  FakeRoot root("5:memory:/elsewhere\n4:cpu,cpuacct:/job/step\n1:name=systemd:/\n");
  EXPECT_EQ(root.limit_v1("elsewhere", 100000, 100000).quota(), std::nullopt);
  EXPECT_EQ(root.limit_v1("job/step", -1, 100000).quota(), std::nullopt);
  EXPECT_EQ(root.limit_v1("job/step", 300000, 100000).quota(), 3.0);
}

TEST(Processors, SmallestQuotaOfAllGroupsAroundHolds) {
  FakeRoot second("0::/outer/middle/inner\n");
  second.limit("outer/middle/inner", "400000 100000").limit("outer/middle", "max 100000");
  EXPECT_EQ(second.quota(), 4.0);
  EXPECT_EQ(second.limit("outer", "200000 100000").quota(), 2.0);
  EXPECT_EQ(second.limit("outer/middle/inner", "100000 100000").quota(), 1.0);
  FakeRoot first("2:cpu:/outer/inner\n");
  first.limit_v1("outer/inner", 400000, 100000).limit_v1("outer", 150000, 100000);
  EXPECT_EQ(first.quota(), 1.5);
  EXPECT_EQ(first.limit_v1("", 50000, 100000).quota(), 0.5);
}

TEST(Processors, ContainerSeesItsGroupAtTheRoot) {
  FakeRoot root("0::/docker/0123abcd\n");
  EXPECT_EQ(root.limit("", "250000 100000").quota(), 2.5);
}

TEST(Processors, BothVersionsTogetherCount) {
  FakeRoot root("3:cpu,cpuacct:/a\n0::/b\n");
  EXPECT_EQ(root.limit_v1("a", 300000, 100000).quota(), 3.0);
  EXPECT_EQ(root.limit("b", "200000 100000").quota(), 2.0);
  EXPECT_EQ(root.limit("b", "500000 100000").quota(), 3.0);
}

TEST(Processors, UnreadableLimitsAreNone) {
  for (const char* text : {"", "none", "none 100000", "100000", "100000 0", "0 100000"})
    EXPECT_EQ(FakeRoot("0::/a\n").limit("a", text).quota(), std::nullopt) << text;
  for (const char* groups : {"", "\n", "0::", "no groups at all\n"})
    EXPECT_EQ(FakeRoot(groups).limit("a", "100000 100000").quota(), std::nullopt) << groups;
}

TEST(Processors, UsableAreThoseOfMaskAndQuota) {
  EXPECT_EQ((Processors{.online = 8, .allowed = 8, .quota = {}}).usable(), 8);
  EXPECT_EQ((Processors{.online = 8, .allowed = 3, .quota = {}}).usable(), 3);
  EXPECT_EQ((Processors{.online = 8, .allowed = 8, .quota = 1.5}).usable(), 2);
  EXPECT_EQ((Processors{.online = 8, .allowed = 8, .quota = 0.1}).usable(), 1);
  EXPECT_EQ((Processors{.online = 8, .allowed = 3, .quota = 6.0}).usable(), 3);
  EXPECT_TRUE((Processors{.online = 8, .allowed = 8, .quota = {}}).are_all_usable());
  EXPECT_FALSE((Processors{.online = 8, .allowed = 7, .quota = {}}).are_all_usable());
  EXPECT_FALSE((Processors{.online = 8, .allowed = 8, .quota = 8.0}).are_all_usable());
}

TEST(Processors, LoadAverageIsThatOfTheLastMinute) {
  FakeRoot root("");
  EXPECT_EQ(load_average(root.path()), std::nullopt);
  root.write("proc/loadavg", "1.25 0.50 0.10 2/345 6789\n");
  EXPECT_EQ(load_average(root.path()), 1.25);
}

}  // namespace
}  // namespace tomofield::base
