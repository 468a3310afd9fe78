#include "compare/methods.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace tomofield::compare {
namespace {

TEST(Methods, EveryBaselineHasAName) {
  std::set<std::string> baselines;
  for (const Method& method : known_methods()) {
    if (method.arguments.front() == "baseline") baselines.insert(method.arguments.at(1));
  }
  EXPECT_EQ(baselines,
            (std::set<std::string>{"wbp", "sirt", "sart-tv", "tv", "tensorf", "ingp", "implicit"}));
}

TEST(Methods, ThoseWithACheckpointAreResumed) {
  for (const Method& method : known_methods()) {
    const bool has_checkpoint =
        method.arguments.front() == "reconstruct" || method.arguments.at(1) == "tensorf";
    EXPECT_EQ(method.resumes, has_checkpoint) << method.name;
  }
}

}  // namespace
}  // namespace tomofield::compare
