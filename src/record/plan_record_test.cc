#include "record/plan_record.h"

#include <gtest/gtest.h>

#include "io/saving/atomic_file.h"
#include "io/tables/text_lines.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::record {
namespace {

using testing::ScratchDirectory;

PlanRecord example() {
  return {.stack = "/data/a.mrc",
          .num_views = 41,
          .view_size_px = {96, 64},
          .pixel_size_A = 13.37,
          .num_parameters = 1000,
          .num_trials = 6,
          .open_variation = true,
          .open_prior = true,
          .num_steps = 300,
          .num_threads = 4,
          .memory_bytes = 1300,
          .memory_bytes_of_one_thread = 1000,
          .core_seconds = 1.5,
          .sample_steps = 1e9,
          .result_bytes = 7,
          .disk_bytes = 9,
          .inputs = {"a.mrc", "a.tlt"},
          .results = {"out/a.mrc", "out/a.h5"},
          .relion_tomogram = "TS_01"};
}

TEST(PlanRecord, IsReadAsItIsWritten) {
  const ScratchDirectory directory;
  const auto file = directory / "plan.json";
  PlanRecord plan = example();
  write_plan(file, plan);
  PlanRecord read = read_plan(file);
  EXPECT_EQ(read.stack, plan.stack);
  EXPECT_EQ(read.view_size_px, plan.view_size_px);
  EXPECT_EQ(read.num_threads, 4);
  EXPECT_EQ(read.memory_bytes_of_one_thread, 1000);
  EXPECT_EQ(read.core_seconds, 1.5);
  EXPECT_TRUE(read.open_variation);
  EXPECT_FALSE(read.open_spike_rank);
  EXPECT_EQ(read.inputs, plan.inputs);
  EXPECT_EQ(read.results, plan.results);
  EXPECT_EQ(read.relion_tomogram, "TS_01");
  plan.core_seconds.reset();
  write_plan(file, plan);
  EXPECT_FALSE(read_plan(file).core_seconds.has_value());
}

TEST(PlanRecord, OfOtherContentsIsRefusedWithItsName) {
  const ScratchDirectory directory;
  const auto file = directory / "plan.json";
  write_plan(file, example());
  const std::string whole = io::read_text_file(file);
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = whole;
    text.replace(text.find(from), from.size(), to);
    return directory.write("plan.json", text);
  };
  for (const auto& [from, to] : {std::pair{"\"threads\": 4", "\"threads\": 0"},
                                 std::pair{"\"core_seconds\": 1.5", "\"core_seconds\": -1"},
                                 std::pair{"\"disk_bytes\": 9", "\"disk_bytes\": \"x\""},
                                 std::pair{"\"trials\"", "\"tries\""}}) {
    const auto changed = with(from, to);
    EXPECT_NE(testing::message_of<Error>([&] { read_plan(changed); }).find("plan.json"),
              std::string::npos)
        << to;
  }
}

TEST(PlannedVolume, IsReadAsItIsWritten) {
  const ScratchDirectory directory;
  const auto file = directory / "grid.json";
  write_planned_volume(file, {{{48, 24, 36}, 13.372}, {"a.mrc", "a.h5"}});
  const PlannedVolume read = read_planned_volume(file);
  EXPECT_EQ(read.grid.size, (std::array<std::int64_t, 3>{48, 24, 36}));
  EXPECT_EQ(read.grid.voxel_A, 13.372);
  EXPECT_EQ(read.files, (std::vector<std::filesystem::path>{"a.mrc", "a.h5"}));
  EXPECT_THROW(read_planned_volume(directory.write("grid.json", R"({"grid": {"size": [1, 2]}})")),
               Error);
}

}  // namespace
}  // namespace tomofield::record
