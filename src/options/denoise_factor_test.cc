#include "options/run_options.h"

#include <gtest/gtest.h>

#include "tomofield/error.h"

namespace tomofield::options {
namespace {

TEST(DenoiseFactor, IsThatOfAPlaceOrANumber) {
  EXPECT_EQ(denoise_factor("light"), 0.5);
  EXPECT_EQ(denoise_factor("medium"), 1.0);
  EXPECT_EQ(denoise_factor("strong"), 2.0);
  EXPECT_EQ(denoise_factor("1.25"), 1.25);
  for (const char* wrong : {"", "Strong", "0", "-1", "21", "nan", "inf", "1.5x", "medium "})
    EXPECT_THROW(denoise_factor(wrong), Error) << wrong;
}

}  // namespace
}  // namespace tomofield::options
