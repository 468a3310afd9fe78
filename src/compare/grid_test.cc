#include "compare/grid.h"

#include <gtest/gtest.h>

#include <vector>

#include "io/images/mrc.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::compare {
namespace {

using testing::message_of;
using testing::ScratchDirectory;

TEST(OneGrid, IsRequiredOfAllVolumes) {
  const NamedGrid main{"vm", {{48, 36, 24}, 13.372}};
  EXPECT_NO_THROW(require_one_grid(main, {"tv", {{48, 36, 24}, 13.37}})) << "four digits";
  EXPECT_NO_THROW(require_one_grid(main, {"tv", {{48, 36, 24}, 0}})) << "not known";
  for (const Grid& other :
       {Grid{{48, 36, 25}, 13.37}, Grid{{48, 24, 36}, 13.37}, Grid{{48, 36, 24}, 26.74}}) {
    const std::string message = message_of<Error>([&] {
      require_one_grid(main, {"other", other});
    });
    EXPECT_NE(message.find("other"), std::string::npos) << message;
    EXPECT_NE(message.find("vm gives 48 × 36 × 24"), std::string::npos) << message;
  }
}

class TruthOf : public ::testing::Test {
 protected:
  bool fits(const std::array<std::int64_t, 3>& size, double voxel_A, bool is_a_part = false) const {
    const auto path = directory_ / "truth.mrc";
    io::MrcSpec spec{.nx = size[0], .ny = size[1], .nz = size[2], .labels = {}};
    spec.voxel_size_A.fill(voxel_A);
    io::MrcWriter(path, spec).close();
    return message_of<Error>([&] {
             require_truth_fits(path, {"vm", {{48, 36, 24}, 10}}, is_a_part);
           })
        .empty();
  }
  ScratchDirectory directory_;
};

TEST_F(TruthOf, AnotherSpecimenIsRefused) {
  EXPECT_TRUE(fits({48, 36, 24}, 10));
  EXPECT_TRUE(fits({48, 36, 26}, 10.1)) << "the common box is scored";
  EXPECT_TRUE(fits({48, 36, 24}, 1)) << "not known";
  EXPECT_FALSE(fits({48, 24, 36}, 10)) << "another order of the axes";
  EXPECT_FALSE(fits({48, 36, 24}, 11));
  EXPECT_FALSE(fits({97, 36, 24}, 10));
  EXPECT_FALSE(fits({23, 36, 24}, 10));
  EXPECT_TRUE(fits({97, 36, 24}, 10, true)) << "its ORIGIN says where it lies";
}

}  // namespace
}  // namespace tomofield::compare
