#include "distributed/communicator.h"

#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "distributed/gathered_arrays.h"

// These tests run on one rank; tests/program/mpi_test.py tests several.
namespace tomofield::distributed {
namespace {

TEST(Communicator, AloneNothingChanges) {
  const Communicator& alone = Communicator::alone();
  EXPECT_EQ(alone.rank(), 0);
  EXPECT_EQ(alone.size(), 1);
  EXPECT_TRUE(alone.is_root());
  std::vector<double> values{1.5, -2.0};
  alone.allreduce_sum(std::span(values));
  EXPECT_EQ(values, (std::vector<double>{1.5, -2.0}));
  EXPECT_EQ(alone.allreduce_max(-3.0), -3.0);
  EXPECT_EQ(alone.broadcast("text"), "text");
  alone.exchange({});
  EXPECT_EQ(alone.traffic().bytes, 0);
}

TEST(Communicator, AloneAnErrorIsNotShared) {
  try {
    Communicator::alone().run_collectively([] { throw Error("as it was"); });
    FAIL() << "it was lost";
  } catch (const SharedError&) {
    FAIL() << "nobody shares it";
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "as it was");
  }
}

bool is_part(const std::map<std::string, std::string>& environment) {
  return is_part_of_a_job([&](const char* name) -> const char* {
    const auto found = environment.find(name);
    return found == environment.end() ? nullptr : found->second.c_str();
  });
}

TEST(Session, TellsFromTheEnvironmentWhetherOthersWereStarted) {
  EXPECT_FALSE(is_part({}));
  EXPECT_TRUE(is_part({{"OMPI_COMM_WORLD_SIZE", "4"}, {"PMIX_RANK", "0"}}));
  EXPECT_FALSE(is_part({{"OMPI_COMM_WORLD_SIZE", "1"}, {"PMIX_RANK", "0"}}));
  EXPECT_TRUE(is_part({{"PMI_RANK", "1"}, {"PMI_SIZE", "2"}}));
  // The cases are srun with and without MPI support, and a batch script in a job of four.
  EXPECT_TRUE(is_part({{"SLURM_STEP_NUM_TASKS", "4"}, {"PMIX_RANK", "3"}}));
  EXPECT_FALSE(is_part({{"SLURM_STEP_NUM_TASKS", "4"}}));
  EXPECT_FALSE(is_part({{"SLURM_NTASKS", "4"}, {"SLURM_PROCID", "0"}}));
}

TEST(GatheredArrays, AloneHandsOutAllOfThemInOrder) {
  std::vector<float> first(3 << 20), second(first.size(), 2.0f);
  for (std::size_t i = 0; i < first.size(); ++i) first[i] = static_cast<float>(i % 1000);
  GatheredArrays arrays(Communicator::alone(), 0, first.size());
  const std::size_t a = arrays.add(first), b = arrays.add(second);
  std::vector<float> seen_first, seen_second;
  int pieces = 0;
  arrays.read_on_root([&] {
    arrays.hand_out(b, [&](std::span<const float> piece) {
      seen_second.insert(seen_second.end(), piece.begin(), piece.end());
    });
    arrays.hand_out(a, [&](std::span<const float> piece) {
      ++pieces;
      seen_first.insert(seen_first.end(), piece.begin(), piece.end());
    });
  });
  EXPECT_GT(pieces, 1);
  EXPECT_EQ(seen_first, first);
  EXPECT_EQ(seen_second, second);
}

}  // namespace
}  // namespace tomofield::distributed
