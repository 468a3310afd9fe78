// Tests fits that have coarse stages before the fine one.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/enum_names.h"
#include "base/threads/parallel.h"
#include "checkpoint/checkpoint.h"
#include "fit/fit.h"
#include "lone_bead_series.h"
#include "output/model_file.h"
#include "scratch_directory.h"

namespace tomofield::fit {
namespace {

using testing::Bead;
using testing::BeadSeries;
using testing::small_field;
using testing::tilts;

// Fits 25 views of a bead in a coarse and a fine stage.
class CoarseToFine : public ::testing::TestWithParam<FieldKind> {
 protected:
  static constexpr int kCoarseEpochs = 4, kEpochs = 3;
  std::unique_ptr<Fit> make_fit(int coarse_epochs = kCoarseEpochs) const {
    return make_fit(measurement_, coarse_epochs);
  }
  static std::unique_ptr<Fit> make_fit(const measurement::Measurement& measurement,
                                       int coarse_epochs = kCoarseEpochs) {
    FieldOptions field = small_field(GetParam());
    field.with_margin = false;
    FitOptions options;
    options.coarse_epochs = coarse_epochs;
    options.epochs = kEpochs;
    options.subsets = 5;
    options.fit_view_scale = true;
    return std::make_unique<Fit>(measurement, field, options);
  }
  // Returns the root mean square distance between the field's density and the bead's.
  double error_of(const Fit& fit) const {
    double squares = 0, n = 0;
    for (double z = 0.5; z < 24; ++z) {
      for (double y = 0.5; y < 43; ++y) {
        for (double x = 0.5; x < 41; ++x, ++n) {
          const auto inside = [&](const std::array<double, 3>& c, double radius) {
            return std::hypot(x - c[0], y - c[1], z - c[2]) < radius;
          };
          const double truth =
              inside(bead_.large, Bead::kLarge) || inside(bead_.small, Bead::kSmall) ? 1 : 0;
          squares += std::pow(fit.field().density(x, y, z) - truth, 2);
        }
      }
    }
    return std::sqrt(squares / n);
  }
  const Bead bead_{{17.3, 20.6, 11.2}};
  const BeadSeries series_{geometry::centred_geometry(41, 43, 24, tilts(-60, 60, 5)), bead_, 3};
  const measurement::Measurement measurement_ = series_.measurement();
};
INSTANTIATE_TEST_SUITE_P(Kinds, CoarseToFine, ::testing::Values(FieldKind::kVm, FieldKind::kGrid),
                         [](const auto& kind) { return base::name_of(kind.param); });

TEST_P(CoarseToFine, StartsTheFineStageCloserToTheSpecimen) {
  const auto both = make_fit(), fine_alone = make_fit(0);
  EXPECT_EQ(fine_alone->num_steps(), kEpochs * 5);
  ASSERT_EQ(both->num_steps(), (kCoarseEpochs + kEpochs) * 5);
  std::size_t coarse_size = 0, fine_size = 0;
  double coarse_error = 0;
  both->run([&](const Fit& fit) {
    const std::int64_t step = fit.progress().step;
    if (step == 1) coarse_size = fit.field().num_parameters();
    if (step == kCoarseEpochs * 5) coarse_error = error_of(fit);  // the field was just refined
    fine_size = fit.field().num_parameters();
    return true;
  });
  fine_alone->run([](const Fit&) { return true; });
  EXPECT_EQ(fine_size, fine_alone->field().num_parameters());
  EXPECT_LT(coarse_size, fine_size / 3);
  EXPECT_EQ(both->progress().data_loss.size(), static_cast<std::size_t>(kCoarseEpochs + kEpochs));
  EXPECT_LT(error_of(*both), error_of(*fine_alone));
  EXPECT_LT(error_of(*both), coarse_error);
}

TEST_P(CoarseToFine, GoesOnFromACheckpointOfEitherStageToTheSameBits) {
  const auto whole = make_fit();
  whole->run([](const Fit&) { return true; });
  for (const std::int64_t pause_at : {3, kCoarseEpochs * 5 - 1, kCoarseEpochs * 5, 27}) {
    const testing::ScratchDirectory scratch;
    const auto first = make_fit();
    first->run([&](const Fit& fit) { return fit.progress().step != pause_at; });
    output::ModelInfo info;
    info.geometry = measurement_.geometry;
    info.roi = measurement_.roi;
    checkpoint::save_checkpoint(scratch / "fit.h5", *first, info,
                                {.fingerprint = "{}", .tuned = {}});
    const auto second = make_fit();
    checkpoint::restore_fit(scratch / "fit.h5", "{}", *second);
    EXPECT_EQ(second->progress().step, pause_at);
    second->run([](const Fit&) { return true; });
    EXPECT_TRUE(std::ranges::equal(second->field().parameters(), whole->field().parameters()))
        << pause_at;
    EXPECT_EQ(second->progress().data_loss, whole->progress().data_loss);
    EXPECT_EQ(second->progress().views[2].offset, whole->progress().views[2].offset);
  }
}

TEST_P(CoarseToFine, GoesOnToTheSameBitsFromAMeasurementThatIsReadAgain) {
  const auto whole = make_fit(), reread = make_fit();
  whole->run([](const Fit&) { return true; });
  for (const std::int64_t pause_at : {3, 10, kCoarseEpochs * 5, 27}) {
    reread->run([&](const Fit& fit) { return fit.progress().step != pause_at; });
    ASSERT_EQ(reread->progress().step, pause_at);
    reread->reread_measurement();
  }
  reread->run([](const Fit&) { return true; });
  EXPECT_TRUE(std::ranges::equal(reread->field().parameters(), whole->field().parameters()));
  EXPECT_EQ(reread->progress().data_loss, whole->progress().data_loss);
  EXPECT_EQ(reread->progress().views[2].scale, whole->progress().views[2].scale);
}

TEST_P(CoarseToFine, TakesOverRaysAndTiltsThatWereReplaced) {
  measurement::Measurement changing = measurement_;
  const auto fit = make_fit(changing);
  fit->run([](const Fit& f) { return f.progress().step != 6; });
  const auto predicted = [&](int view) {
    return fit->predict(std::span(&view, 1), std::vector(1, measurement::ViewModel{}))[0];
  };
  constexpr int kView = 4;
  const std::vector<float> of_next = predicted(kView + 1).predicted;
  // Every view gets the tilt of the next one, and the rays of a bead that is elsewhere.
  const BeadSeries other(changing.geometry, Bead({24.0, 15.5, 13.0}), 3);
  changing.rays = other.measurement().rays;
  std::rotate(changing.geometry.tilt_deg.begin(), changing.geometry.tilt_deg.begin() + 1,
              changing.geometry.tilt_deg.end());
  EXPECT_NE(predicted(kView).predicted, of_next);
  fit->reread_measurement();
  const measurement::PredictedView after = predicted(kView);
  EXPECT_EQ(after.predicted, of_next);
  const auto rays = other.measurement().rays->binned(fit->stage().bin);
  int num_rays = 0;
  for (std::int64_t i = 0; i < std::ssize(after.measured); ++i) {
    const std::int64_t x = i % after.width, y = i / after.width;
    if (!rays->counts(kView, x, y)) continue;
    ASSERT_EQ(after.measured[static_cast<std::size_t>(i)], rays->ray(kView, x, y));
    ++num_rays;
  }
  EXPECT_GT(num_rays, 50);
}

TEST_P(CoarseToFine, SameBitsForAnyNumberOfThreads) {
  const auto run = [&](int threads) {
    base::set_thread_count(threads);
    const auto fit = make_fit(1);
    fit->run([](const Fit&) { return true; });
    base::set_thread_count(0);
    return std::vector<float>(fit->field().parameters().begin(), fit->field().parameters().end());
  };
  EXPECT_EQ(run(1), run(3));
}

TEST_P(CoarseToFine, KeepsTheViewsAtTheModelsOfAnotherFit) {
  const auto first = make_fit();
  first->run([](const Fit&) { return true; });
  const auto second = make_fit();
  std::vector<measurement::ViewModel> models = first->progress().views;
  models[3] = {1.25, -0.5, 70.0, 0.4};
  second->keep_views(models);
  second->run([&](const Fit& fit) {
    EXPECT_EQ(fit.progress().views[3].scale, 1.25);
    return true;
  });
  for (std::size_t v = 0; v < models.size(); ++v) {
    EXPECT_EQ(second->progress().views[v].scale, models[v].scale);
    EXPECT_EQ(second->progress().views[v].offset, models[v].offset);
    EXPECT_EQ(second->progress().views[v].weight, models[v].weight);
    EXPECT_EQ(second->progress().views[v].largest_residual, models[v].largest_residual);
  }
}

}  // namespace
}  // namespace tomofield::fit
