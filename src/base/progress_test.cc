#include "base/progress.h"

#include <gtest/gtest.h>

namespace tomofield::base {
namespace {

TEST(TimeText, HasTheUnitsThatPeopleUse) {
  EXPECT_EQ(time_text(0.4), "0 s");
  EXPECT_EQ(time_text(59.4), "59 s");
  EXPECT_EQ(time_text(59.6), "1 min 00 s");
  EXPECT_EQ(time_text(200), "3 min 20 s");
  EXPECT_EQ(time_text(7500), "2 h 05 min");
}

}  // namespace
}  // namespace tomofield::base
