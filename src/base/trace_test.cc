#include "base/trace.h"

#include <gtest/gtest.h>

#include <chrono>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "base/threads/parallel.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::base {
namespace {

using nlohmann::json;
using testing::ScratchDirectory;

// Records while it lives, and reads what was recorded under names that begin with `prefix`.
class Recording {
 public:
  explicit Recording(std::string prefix) : prefix_(std::move(prefix)) { trace::start(); }
  ~Recording() { trace::is_on = false; }

  std::vector<json> events(const std::string& kind) const {
    const ScratchDirectory directory;
    trace::write(directory / "trace.json");
    const json all = json::parse(testing::read_whole_file(directory / "trace.json"));
    std::vector<json> found;
    for (const json& event : all["traceEvents"]) {
      if (event["cat"] == kind && event["name"].get<std::string>().starts_with(prefix_))
        found.push_back(event);
    }
    return found;
  }

 private:
  std::string prefix_;
};

bool lies_within(const json& inner, const json& outer) {
  constexpr double kRounding = 1e-3;  // microseconds
  const double begin = inner["ts"], end = begin + inner["dur"].get<double>();
  const double outer_begin = outer["ts"], outer_end = outer_begin + outer["dur"].get<double>();
  return begin >= outer_begin - kRounding && end <= outer_end + kRounding;
}

class TraceThreads : public ::testing::TestWithParam<int> {
 protected:
  void SetUp() override { set_thread_count(GetParam()); }
  void TearDown() override { set_thread_count(0); }
};
INSTANTIATE_TEST_SUITE_P(Threads, TraceThreads, ::testing::Values(1, 3));

TEST_P(TraceThreads, NothingIsRecordedBeforeTheStart) {
  {
    const TraceSpan span("off span");
    const TraceTasks tasks(true);
    parallel_for("off loop", 5, [](std::int64_t) {});
  }
  const Recording recording("off");
  for (const char* kind : {"span", "loop", "task"}) EXPECT_TRUE(recording.events(kind).empty());
}

TEST_P(TraceThreads, SpansNest) {
  const Recording recording("span");
  {
    const TraceSpan outer("span outer");
    const TraceSpan inner("span inner");
  }
  const std::vector<json> spans = recording.events("span");
  ASSERT_EQ(spans.size(), 2);
  EXPECT_EQ(spans[0]["name"], "span inner");
  EXPECT_TRUE(lies_within(spans[0], spans[1])) << spans[0] << spans[1];
}

// Runs 4 outer tasks with 3 inner ones each.
void run_nested_loops() {
  parallel_for("tree outer", 4,
               [](std::int64_t) { parallel_for("tree inner", 3, [](std::int64_t) {}); });
}

TEST_P(TraceThreads, TasksFormATree) {
  const Recording recording("tree");
  {
    const TraceTasks tasks(true);
    run_nested_loops();
  }
  std::map<int, json> loops, tasks;
  std::map<int, std::set<int>> indices;  // of a loop's tasks
  std::map<int, double> busy;
  for (const json& loop : recording.events("loop")) loops[loop["args"]["loop"]] = loop;
  for (const json& task : recording.events("task")) {
    const int loop = task["args"]["loop"];
    tasks[task["args"]["task"]] = task;
    indices[loop].insert(task["args"]["index"].get<int>());
    busy[loop] += 1e-6 * task["dur"].get<double>();
    ASSERT_TRUE(loops.contains(loop)) << task;
    EXPECT_EQ(task["name"], loops[loop]["name"]);
    EXPECT_TRUE(lies_within(task, loops[loop])) << task << loops[loop];
    EXPECT_LT(task["tid"].get<int>(), GetParam());
  }
  ASSERT_EQ(loops.size(), 1 + 4);
  ASSERT_EQ(tasks.size(), 4 + 4 * 3);
  std::set<int> outer_tasks;
  for (const auto& [id, loop] : loops) {
    const bool is_inner = loop["name"] == "tree inner";
    const int in_task = loop["args"]["in_task"];
    EXPECT_EQ(loop["args"]["tasks"], is_inner ? 3 : 4);
    EXPECT_EQ(indices[id].size(), is_inner ? 3 : 4);
    EXPECT_NEAR(loop["args"]["busy_s"].get<double>(), busy[id], 1e-8);
    EXPECT_LE(loop["args"]["longest_s"].get<double>(), loop["args"]["busy_s"].get<double>());
    EXPECT_EQ(in_task >= 0, is_inner);
    if (!is_inner) continue;
    ASSERT_TRUE(tasks.contains(in_task));
    EXPECT_EQ(tasks[in_task]["name"], "tree outer");
    EXPECT_TRUE(lies_within(loop, tasks[in_task]));
    outer_tasks.insert(in_task);
  }
  EXPECT_EQ(outer_tasks.size(), 4);
}

TEST_P(TraceThreads, WithoutTasksOnlyOutermostLoopsAreRecorded) {
  const Recording recording("plain");
  { const TraceTasks ended_before(true); }
  const TraceTasks unwanted(false);
  parallel_for("plain outer", 4,
               [](std::int64_t) { parallel_for("plain inner", 3, [](std::int64_t) {}); });
  const std::vector<json> loops = recording.events("loop");
  ASSERT_EQ(loops.size(), 1);
  EXPECT_EQ(loops[0]["name"], "plain outer");
  EXPECT_EQ(loops[0]["args"]["tasks"], 4);
  EXPECT_GT(loops[0]["args"]["busy_s"].get<double>(), 0);
  EXPECT_TRUE(recording.events("task").empty());
}

// The tasks of one loop are recorded together: here one of them begins to want tasks.
TEST_P(TraceThreads, LoopThatBeganBeforeTasksWereWantedHasNone) {
  const Recording recording("late");
  parallel_for("late outer", 8, [](std::int64_t i) {
    if (i != 0) return;
    const TraceTasks tasks(true);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  });
  EXPECT_EQ(recording.events("loop").size(), 1);
  EXPECT_TRUE(recording.events("task").empty());
}

TEST(Trace, UnwritableFileIsAnError) {
  const ScratchDirectory directory;
  EXPECT_THROW(trace::write(directory / "absent/trace.json"), Error);
}

}  // namespace
}  // namespace tomofield::base
