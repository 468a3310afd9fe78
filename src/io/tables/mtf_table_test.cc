#include "io/tables/mtf_table.h"

#include <gtest/gtest.h>

#include "expect_parts.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

using testing::expect_parts;
using testing::message_of;
using testing::ScratchDirectory;

const std::string kHead = "data_\n\nloop_\n_rlnResolutionInversePixel #1\n_rlnMtfValue #2\n";

std::string refusal(const std::string& text) {
  const ScratchDirectory scratch;
  const auto path = scratch.write("mtf.star", text);
  return message_of<Error>([&] { read_mtf(path); });
}

TEST(MtfTable, ReadsRelion) {
  const ScratchDirectory scratch;
  const MtfTable mtf = read_mtf(
      scratch.write("mtf.star", kHead + "0.000000 1.000000\n0.250000 0.800000\n0.5 0.35\n"));
  EXPECT_EQ(mtf.frequencies, (std::vector<double>{0, 0.25, 0.5}));
  EXPECT_EQ(mtf.values, (std::vector<double>{1, 0.8, 0.35}));
}

TEST(MtfTable, RefusesWhatIsNoTransferFunction) {
  expect_parts(refusal("data_\nloop_\n_rlnX #1\n1\n"), {"mtf.star", "rlnMtfValue"});
  expect_parts(refusal(kHead + "0 1\n0.2 0.9\n0.1 0.8\n"), {"row 3", "0.1", "must rise"});
  expect_parts(refusal(kHead + "0 1\n0.2 -0.9\n"), {"row 2", "-0.9"});
  expect_parts(refusal(kHead + "0 1\n"), {"fewer than two"});
  expect_parts(
      refusal(kHead + "0 1\n0.5 0.3\n\ndata_other\n\nloop_\n_rlnResolutionInversePixel #1\n"
                      "_rlnMtfValue #2\n0 1\n0.5 0.2\n"),
      {"mtf.star", "several tables"});
}

}  // namespace
}  // namespace tomofield::io
