#include "evaluate/field_artefacts.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/threads/parallel.h"
#include "evaluate/speckle.h"
#include "field/sampling/sample_box.h"
#include "output/volume.h"
#include "uneven_model.h"

namespace tomofield::evaluate {
namespace {

base::Range all_rows(const output::Model& model) {
  return {0, static_cast<int>(model.roi.height())};
}

base::Volume volume_of(const output::Model& model) {
  const field::OrientedBox box = output::region_box(model, 1.0);
  base::Volume volume({box.size[0], box.size[1], box.size[2]});
  volume.data = field::sample_box(*model.field, box);
  return volume;
}

TEST(FieldArtefacts, AreThoseOfItsVolume) {
  for (const FieldKind kind : {FieldKind::kVm, FieldKind::kGrid}) {
    const output::Model model = testing::uneven_model(kind);
    const FieldArtefacts found = find_artefacts(*model.field, model.roi, all_rows(model));
    const base::Volume volume = volume_of(model);
    const auto jump = face_jump(volume, LeafFaces(model.field->tree(), model.roi));
    ASSERT_TRUE(found.speckle && found.faces && jump);
    EXPECT_NEAR(*found.speckle, *speckle(volume), 1e-12);
    EXPECT_GT(*found.speckle, 0.0);
    EXPECT_NEAR(found.faces->both, jump->both, 1e-12);
    EXPECT_NEAR(*found.faces->x, *jump->x, 1e-12);
    EXPECT_NEAR(*found.faces->y, *jump->y, 1e-12);
    ASSERT_EQ(std::ssize(found.section_mean), volume.shape.nz);
    const auto size = static_cast<double>(volume.shape.nx * volume.shape.ny);
    double mean = 0, squares = 0;
    for (std::int64_t i = 0; i < volume.shape.nx * volume.shape.ny; ++i)
      mean += static_cast<double>(volume.at(i, 0, 4)) / size;
    for (std::int64_t i = 0; i < volume.shape.nx * volume.shape.ny; ++i)
      squares += std::pow(static_cast<double>(volume.at(i, 0, 4)) - mean, 2) / size;
    EXPECT_NEAR(found.section_mean[4], mean, 1e-9);
    EXPECT_NEAR(found.section_deviation[4], std::sqrt(squares), 1e-7);
  }
}

TEST(FieldArtefacts, HaveTheSameBitsForAnyNumberOfThreads) {
  const output::Model model = testing::uneven_model(FieldKind::kVm);
  std::vector<FieldArtefacts> found;
  for (const int threads : {1, 3}) {
    base::set_thread_count(threads);
    found.push_back(find_artefacts(*model.field, model.roi, all_rows(model)));
  }
  base::set_thread_count(0);
  EXPECT_EQ(found[0].speckle, found[1].speckle);
  EXPECT_EQ(found[0].faces->both, found[1].faces->both);
  EXPECT_EQ(found[0].section_deviation, found[1].section_deviation);
}

}  // namespace
}  // namespace tomofield::evaluate
