#include "report/embedded_volume.h"

#include <gtest/gtest.h>

#include <functional>

#include "base/random.h"
#include "io/images/mrc.h"
#include "io/json.h"
#include "report/contrast.h"
#include "scratch_directory.h"

namespace tomofield::report {
namespace {

void write_volume(const std::filesystem::path& path, std::int64_t side,
                  const std::function<float(std::int64_t)>& voxel) {
  io::MrcWriter writer(path, {.nx = side, .ny = side, .nz = side, .labels = {}});
  std::vector<float> section(static_cast<std::size_t>(side * side));
  for (std::int64_t z = 0; z < side; ++z) {
    for (std::size_t i = 0; i < section.size(); ++i)
      section[i] = voxel(z * side * side + static_cast<std::int64_t>(i));
    writer.write_section(z, section);
  }
  writer.close();
}

TEST(EmbeddedVolume, HasLimitsBeyondTheContrast) {
  const testing::ScratchDirectory directory;
  write_volume(directory / "v.mrc", 10, [](std::int64_t i) { return static_cast<float>(i); });
  const EmbeddedVolume volume = embed_volume(directory / "v.mrc");
  const Contrast contrast = contrast_of(io::MrcReader(directory / "v.mrc"));
  EXPECT_EQ(volume.contrast, (std::pair{contrast.black, contrast.white}));
  const double half = (contrast.white - contrast.black) / 2;
  EXPECT_EQ(volume.limits, (std::pair{contrast.black - half, contrast.white + half}));
  EXPECT_EQ(volume.size, (std::array<std::int64_t, 3>{10, 10, 10}));
  EXPECT_EQ(volume.tile, (std::array<std::int64_t, 2>{16, 16}));  // whole blocks of JPEG
  EXPECT_EQ(volume.sheets.size(), 1u);
  EXPECT_EQ(io::parse_json(text_of(volume)).at("sheets").size(), 1u);
}

TEST(EmbeddedVolume, OfOneValueHasAContrastAllTheSame) {
  const testing::ScratchDirectory directory;
  write_volume(directory / "v.mrc", 4, [](std::int64_t) { return 7.0f; });
  const EmbeddedVolume volume = embed_volume(directory / "v.mrc");
  EXPECT_LT(volume.contrast.first, volume.contrast.second);
  EXPECT_LT(volume.limits.first, volume.limits.second);
}

TEST(EmbeddedVolume, OfNoiseIsNotLargerThanAllowed) {
  const testing::ScratchDirectory directory;
  constexpr std::int64_t kSide = 224;
  base::Random random(1);
  write_volume(directory / "v.mrc", kSide,
               [&](std::int64_t) { return static_cast<float>(random.uniform()); });
  const EmbeddedVolume volume = embed_volume(directory / "v.mrc");
  std::size_t bytes = 0;
  for (const std::string& sheet : volume.sheets) bytes += sheet.size();
  EXPECT_LE(bytes, kMostSheetBytes);
  EXPECT_GT(bytes, kMostSheetBytes / 4);
}

}  // namespace
}  // namespace tomofield::report
