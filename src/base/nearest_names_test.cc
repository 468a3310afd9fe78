#include "base/nearest_names.h"

#include <gtest/gtest.h>

namespace tomofield::base {
namespace {

using Names = std::vector<std::string>;

TEST(NearestNames, HaveFewOtherLetters) {
  EXPECT_EQ(nearest_names("thicknes", {"tlt", "thickness", "roi"}), Names{"thickness"});
  EXPECT_EQ(nearest_names("xi", {"xf", "xt", "tilt"}), (Names{"xf", "xt"}));
  EXPECT_EQ(nearest_names("tv", {"xf", "tv"}), Names{"tv"});
}

TEST(NearestNames, ShareWords) {
  EXPECT_EQ(nearest_names("thick", {"tlt", "thickness"}), Names{"thickness"});
  EXPECT_EQ(nearest_names("tv-weight", {"tv", "tv-penalty"}), Names{"tv"});
  EXPECT_EQ(nearest_names("margin", {"margin-spacing", "no-margin", "roi"}),
            (Names{"no-margin", "margin-spacing"}));
  EXPECT_EQ(nearest_names("variation", {"density_variation", "bin"}), Names{"density_variation"});
}

TEST(NearestNames, AreFew) {
  EXPECT_EQ(nearest_names("colour", {"tlt", "thickness"}), Names{});
  EXPECT_EQ(nearest_names("t", {"tilt-axis", "tilt-offset", "thickness"}), Names{});
  EXPECT_EQ(nearest_names("view", {"view-a", "view-b", "view-scale", "view-noise"}), Names{});
}

}  // namespace
}  // namespace tomofield::base
