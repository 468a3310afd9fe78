#include "compare/methods.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "tomofield/error.h"

namespace tomofield::compare {
namespace {

TEST(Methods, EveryBaselineHasAName) {
  std::set<std::string> baselines;
  for (const Method& method : known_methods()) {
    if (method.arguments.front() == "baseline") baselines.insert(method.arguments.at(1));
  }
  EXPECT_EQ(baselines, (std::set<std::string>{"wbp", "sirt", "sart-tv", "tv", "tensorf", "ingp",
                                              "fourier-net"}));
}

TEST(Methods, ThoseWithACheckpointAreResumed) {
  for (const Method& method : known_methods()) {
    const bool has_checkpoint =
        method.arguments.front() == "reconstruct" || method.arguments.at(1) == "tensorf";
    EXPECT_EQ(method.resumes, has_checkpoint) << method.name;
  }
}

TEST(Methods, OfTheUserCanWhatTheKnownOnesCan) {
  const auto methods = choose_methods(
      {},
      {"a=baseline tensorf --rank 4", "b=baseline tv --weight 9", "c=reconstruct --field grid"});
  ASSERT_EQ(methods.size(), 3u);
  EXPECT_TRUE(methods[0].resumes && !methods[0].tunes);
  EXPECT_TRUE(!methods[1].resumes && methods[1].tunes);
  EXPECT_TRUE(methods[2].resumes && methods[2].tunes);
}

TEST(Methods, HaveNoNamesOfTheComparisonsOwnFiles) {
  for (const char* name : {"comparison", "report", "pictures", "truth", "vm_tune", "vm.even",
                           "vm.odd", "vm.held_out", "../vm", ""})
    EXPECT_THROW(choose_methods({}, {std::string(name) + "=baseline wbp"}), Error) << name;
  for (const char* name : {"-x", "--config", "=1+1", "+1", "@a", ""})
    EXPECT_THROW(choose_methods({}, {std::string(name) + "=baseline wbp"}), Error) << name;
  EXPECT_NO_THROW(choose_methods({}, {"truthful=baseline wbp"}));
}

}  // namespace
}  // namespace tomofield::compare
