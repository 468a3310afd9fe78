#include "io/mrc.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <vector>

namespace tomofield::io {
namespace {

TEST(Mrc, RoundTrip) {
  const auto path = std::filesystem::temp_directory_path() / "tomofield_mrc_test_io.mrc";
  MrcSpec spec;
  spec.nx = 3;
  spec.ny = 2;
  spec.nz = 2;
  MrcWriter writer(path, spec);
  writer.write_section(0, std::vector<float>{1, 2, 3, 4, 5, 6});
  writer.close();
  MrcReader reader(path);
  std::vector<float> v(6);
  reader.read_section(0, v);
  EXPECT_EQ(v[5], 6);
  EXPECT_EQ(reader.header().max, 6);
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace tomofield::io
