#include "io/saving/output_files.h"

#include <gtest/gtest.h>

#include "expect_parts.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

using testing::message_of;

TEST(VolumeNames, EndAsThoseOfVolumes) {
  for (const char* name : {"a", "a.mrc", "a.REC", "lam1.2.mrc", "a.map"})
    EXPECT_NO_THROW(require_volume_name(name)) << name;
  testing::expect_parts(message_of<Error>([] { require_volume_name("a.TIF"); }), {"a.TIF", ".mrc"});
  // Its model would be called lam1.h5, as that of lam1.3 or lam1.good.
  for (const char* name : {"d/lam1.2", "d/lam1.best", "lam1.", "a.tif", "a.h5"})
    testing::expect_parts(message_of<Error>([&] { require_volume_name(name); }),
                          {std::string("'") + name + ".mrc'"});
}

}  // namespace
}  // namespace tomofield::io
