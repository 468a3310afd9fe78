#include "tilt_series/masks/beads.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "bead_series.h"
#include "io/images/mrc.h"
#include "io/tables/alignment_files.h"
#include "shared_data.h"
#include "tilt_series/masks/fill.h"

namespace tomofield::tilt_series {
namespace {

using testing::BeadScene;
using testing::TrueBead;

double distance_to_nearest(const std::vector<MaskDisc>& discs, double x, double y) {
  double least = 1e9;
  for (const MaskDisc& disc : discs) {
    least = std::min(least, std::hypot(disc.x_px - x, disc.y_px - y));
  }
  return least;
}

/// Every bead that a view sees has a disc, and no disc is anywhere else.
void expect_discs_on_beads(const BeadScene& scene, const BeadSearch& search, double tolerance) {
  for (std::size_t view = 0; view < scene.tilt_deg.size(); ++view) {
    for (const TrueBead& bead : scene.beads) {
      const double x = scene.bead_x(bead, view);
      if (x < 0 || x > static_cast<double>(scene.width)) continue;
      EXPECT_LT(distance_to_nearest(search.discs[view], x, bead.y_px), tolerance)
          << "bead at " << x << ", " << bead.y_px << " of view " << view;
    }
    for (const MaskDisc& disc : search.discs[view]) {
      double least = 1e9;
      for (const TrueBead& bead : scene.beads) {
        least = std::min(least,
                         std::hypot(disc.x_px - scene.bead_x(bead, view), disc.y_px - bead.y_px));
      }
      EXPECT_LT(least, tolerance) << "disc at " << disc.x_px << ", " << disc.y_px << " of view "
                                  << view;
    }
  }
}

TEST(Beads, AreAllFoundAndMeasuredWithoutHelp) {
  BeadScene scene;
  scene.scatter_beads(18, 5);
  const BeadSearch search = find_beads(scene.views(), {});
  EXPECT_EQ(search.num_beads, 18u);
  // A sphere's profile has half its height at sqrt(3)/2 of its diameter.
  EXPECT_NEAR(search.diameter_px, 0.866 * scene.diameter_px, 0.15 * scene.diameter_px);
  // Two beads that overlap in a view make one spot between them.
  expect_discs_on_beads(scene, search, 2.0);
}

TEST(Beads, OfManyPixelsAreFoundToo) {
  BeadScene scene;
  scene.diameter_px = 14;
  scene.scatter_beads(7, 8);
  const BeadSearch search = find_beads(scene.views(), {});
  EXPECT_EQ(search.num_beads, 7u);
  EXPECT_NEAR(search.diameter_px, 0.866 * 14, 2);
  expect_discs_on_beads(scene, search, 4);
}

TEST(Beads, AreMaskedWhereTheyCannotBeSeen) {
  BeadScene scene;
  scene.scatter_beads(8, 11);
  const BeadViews seen = scene.views();
  constexpr std::size_t kDim = 4;
  const BeadViews views{scene.tilt_deg, [&](std::size_t view) {
                          if (view != kDim) return seen.read(view);
                          BeadScene dim = scene;
                          dim.contrast = 1.0;
                          return dim.view(view);
                        }};
  const BeadSearch search = find_beads(views, {});
  EXPECT_EQ(search.num_beads, 8u);
  EXPECT_LT(search.num_found[kDim], 4u);
  expect_discs_on_beads(scene, search, 2.5);
}

TEST(Beads, NoneAreInventedInStructureAndNoise) {
  for (const double noise : {1.0, 0.01}) {
    BeadScene scene;
    scene.noise = noise;
    const BeadSearch search = find_beads(scene.views(), {});
    EXPECT_EQ(search.num_beads, 0u) << "noise " << noise;
    EXPECT_EQ(search.diameter_px, 0.0);
    for (const auto& discs : search.discs) EXPECT_TRUE(discs.empty());
  }
}

TEST(Beads, SpotsThatKeepNoPlaceInTheSpecimenAreNone) {
  const BeadScene scene;
  const BeadViews views{scene.tilt_deg, [&](std::size_t view) {
                          BeadScene other = scene;
                          other.scatter_beads(15, 100 + view);
                          return other.view(view);
                        }};
  EXPECT_EQ(find_beads(views, {}).num_beads, 0u);
}

TEST(Beads, ThatFewViewsSeeAreEvidenceIfTheyShowThemClearly) {
  BeadScene scene;
  scene.beads = {{-20, 30, 5}, {30, 100, -20}};  // in all views
  EXPECT_EQ(find_beads(scene.views(), {}).num_beads, 0u) << "two beads are no clear evidence";
  // These come in from the sides as the tilt grows.
  scene.beads.insert(scene.beads.end(), {{95, 20, 10}, {-98, 70, -15}, {92, 50, 20}});
  const BeadSearch search = find_beads(scene.views(), {});
  EXPECT_EQ(search.num_beads, 5u);
  expect_discs_on_beads(scene, search, 2.5);
}

TEST(Beads, ThatNoViewOfLowTiltShowsAreFound) {
  BeadScene scene;
  scene.beads = {{100, 20, 0}, {-102, 50, 0}, {104, 76, 0}, {-100, 108, 0}};  // seen from 37° on
  for (std::size_t view = 0; view < scene.tilt_deg.size(); ++view) {
    if (std::fabs(scene.tilt_deg[view]) > 30) continue;
    for (const TrueBead& bead : scene.beads)
      ASSERT_GT(std::fabs(scene.bead_x(bead, view) - 80), 80 + scene.diameter_px / 2);
  }
  const BeadSearch search = find_beads(scene.views(), {});
  EXPECT_EQ(search.num_beads, 4u);
  EXPECT_NEAR(search.diameter_px, 0.866 * scene.diameter_px, 0.15 * scene.diameter_px);
  expect_discs_on_beads(scene, search, 2.5);
}

TEST(Beads, OfWhichOnlyTheBrightMiddleStandsOutAreFound) {
  // Fringes make the full width at half height smaller than the disc that stands out most. The
  // search for spots keeps the size of that disc.
  BeadScene scene;
  scene.diameter_px = 6;
  scene.contrast = 7.5;
  scene.scatter_beads(4, 23);
  BeadScene halo = scene;
  halo.diameter_px = 11;
  const BeadViews views{scene.tilt_deg, [&](std::size_t view) {
                          MaskedImage image = scene.view(view);
                          for (const TrueBead& bead : scene.beads)
                            halo.add_sphere(scene.bead_x(bead, view), bead.y_px, -2.5, &image);
                          return image;
                        }};
  const BeadSearch search = find_beads(views, {});
  EXPECT_EQ(search.num_beads, 4u);
  expect_discs_on_beads(scene, search, 2.5);
}

TEST(Beads, AGivenDiameterFindsASingleBead) {
  BeadScene scene;
  scene.scatter_beads(1, 3);
  EXPECT_EQ(find_beads(scene.views(), {}).num_beads, 0u) << "one bead is no clear evidence";
  BeadSearchOptions options;
  options.diameter_px = 5.0;
  const BeadSearch search = find_beads(scene.views(), options);
  EXPECT_EQ(search.num_beads, 1u);
  EXPECT_EQ(search.diameter_px, 5.0);
  expect_discs_on_beads(scene, search, 1.5);
}

TEST(Beads, DiscsMaskThePixelsWhoseCentresTheyHold) {
  MaskedImage image(20, 10);
  std::fill(image.values.begin(), image.values.end(), 1.0f);
  const std::vector<MaskDisc> discs{{6.2, 4.7, 2.5}, {19.5, 0.0, 3.0}, {-40, 3, 4}};
  mask_discs(discs, &image);
  for (std::int64_t y = 0; y < 10; ++y) {
    for (std::int64_t x = 0; x < 20; ++x) {
      const double px = static_cast<double>(x) + 0.5, py = static_cast<double>(y) + 0.5;
      const bool is_in = std::hypot(px - 6.2, py - 4.7) <= 2.5 || std::hypot(px - 19.5, py) <= 3.0;
      ASSERT_EQ(image.valid[image.index(x, y)], is_in ? 0 : 1) << x << ", " << y;
      ASSERT_EQ(image.values[image.index(x, y)], is_in ? 0.0f : 1.0f);
    }
  }
}

TEST(Beads, UndecidedOnesKeepTheirValuesAndAreMarked) {
  MaskedImage image(20, 10);
  std::fill(image.values.begin(), image.values.end(), 1.0f);
  image.valid[image.index(6, 4)] = kNoMeasurement;
  mark_undecided({{6.2, 4.7, 2.5}}, &image);
  EXPECT_EQ(image.valid[image.index(6, 4)], kNoMeasurement);
  EXPECT_EQ(image.valid[image.index(7, 4)], kUndecidedBead);
  EXPECT_EQ(image.valid[image.index(9, 4)], kMeasurement);
  EXPECT_EQ(std::count(image.values.begin(), image.values.end(), 1.0f), 200);
}

/// Every `stride`-th view of a series of the shared data, dense parts high.
struct SharedSeries {
  io::MrcReader stack;
  BeadViews views;

  SharedSeries(const std::string& stack_name, const std::string& angles, Contrast contrast,
               std::int64_t stride)
      : stack(path_of(stack_name)) {
    const auto tilts = io::read_number_column(path_of(angles), "a tilt angle");
    for (std::size_t i = 0; i < tilts.size(); i += static_cast<std::size_t>(stride)) {
      views.tilt_deg.push_back(tilts[i].value);
    }
    views.read = [this, contrast, stride](std::size_t view) {
      MaskedImage image(stack.header().nx, stack.header().ny);
      stack.read_section(static_cast<std::int64_t>(view) * stride, image.values);
      mask_fill(contrast, &image);
      if (contrast == Contrast::kDark) {
        for (float& value : image.values) value = -value;
      }
      return image;
    };
  }

  static std::filesystem::path path_of(const std::string& name) {
    return testing::shared_data() / name;
  }
};

TEST(Beads, OfARealCryoSeriesAreFound) {
  const char* stack = "exosome_cryo/exosome_341x480.ali";
  if (!std::filesystem::exists(SharedSeries::path_of(stack))) GTEST_SKIP() << stack << " is absent";
  const SharedSeries series(stack, "exosome_cryo/exosome.tlt", Contrast::kDark, 2);
  const BeadSearch search = find_beads(series.views, {});
  // By eye there are about 50 in the views of low tilt, and more come in from the sides.
  EXPECT_GE(search.num_beads, 60u);
  EXPECT_LE(search.num_beads, 95u);
  EXPECT_NEAR(search.diameter_px, 3.5, 0.5);
  for (const std::size_t found : search.num_found) EXPECT_GE(found, 30u);
  // Five that are plain to see at 3.6°: the darkest places there of the image as it is stored.
  constexpr std::size_t kView = 7;
  ASSERT_NEAR(series.views.tilt_deg[kView], 3.6, 0.01);
  for (const auto& [x, y] :
       {std::pair{97.5, 454.5}, {228.5, 432.5}, {102.5, 317.5}, {189.5, 172.5}, {283.5, 73.5}}) {
    EXPECT_LT(distance_to_nearest(search.discs[kView], x, y), 1.5) << x << ", " << y;
  }
}

TEST(Beads, RealSeriesWithoutBeadsHaveNone) {
  struct Case {
    const char *stack, *angles;
  };
  for (const Case& c : {Case{"ta_film/area24.ali", "ta_film/ta_film.tlt"},
                        Case{"idp_haadf/haadf_tilt_raw.st", "idp_haadf/haadf_tilt_raw.rawtlt"}}) {
    if (!std::filesystem::exists(SharedSeries::path_of(c.stack))) {
      GTEST_SKIP() << c.stack << " is absent";
    }
    for (const Contrast contrast : {Contrast::kBright, Contrast::kDark}) {
      const SharedSeries series(c.stack, c.angles, contrast, 1);
      EXPECT_EQ(find_beads(series.views, {}).num_beads, 0u) << c.stack;
    }
  }
}

}  // namespace
}  // namespace tomofield::tilt_series
