#include "measurement/held_out.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "base/random.h"
#include "base/threads/parallel.h"
#include "fit/domain.h"
#include "fit/fit.h"
#include "scratch_directory.h"
#include "sphere_series.h"
#include "tomofield/error.h"

namespace tomofield::fit {
namespace {

TEST(HeldOutViews, AreSpreadOverTheTiltsWithoutTheEnds) {
  // In the order of tilts they run from -50 to 50 in steps of 10. They were recorded from the
  // middle outwards.
  const std::vector<double> tilts = {0, 10, -10, 20, -20, 30, -30, 40, -40, 50, -50};
  // The sorted positions 2 and 6 are -30 and 10. Position 10, the last, is always fitted.
  EXPECT_EQ(measurement::held_out_views(tilts, 4), (std::vector<int>{1, 6}));
  EXPECT_EQ(measurement::held_out_views(tilts, 2), (std::vector<int>{0, 3, 4, 7, 8}));
  EXPECT_EQ(measurement::held_out_views(tilts, 19), (std::vector<int>{7}));
  const std::string message =
      testing::message_of<Error>([&] { measurement::held_out_views(tilts, 20); });
  EXPECT_NE(message.find("--hold-out 20"), std::string::npos) << message;
  EXPECT_NE(message.find("11 views"), std::string::npos) << message;
}

// Holds a random field and views of it with noise, gains and offsets.
class KnownField : public ::testing::Test {
 protected:
  static constexpr std::int64_t kWidth = 48, kRows = 40;

  KnownField()
      : geometry_(geometry::centred_geometry(kWidth, kRows, 20, {-60, -30, 0, 20, 45, 60})),
        domain_(make_domain(geometry_, {0, 0, kWidth, kRows}, options())),
        field_(make_initial_field(domain_, 20, 0.5, options(), 3)),
        projector_(geometry_, domain_.grid) {
    base::Random random(11);
    for (float& value : field_->parameters()) value += static_cast<float>(random.uniform(-1, 1));
    sampler_ = std::make_unique<projection::SlabSampler>(*field_, domain_.grid, domain_.first_row,
                                                         domain_.num_rows);
  }

  static FieldOptions options() {
    FieldOptions options;
    options.kind = FieldKind::kGrid;
    options.leaf_size = 16;
    options.with_margin = false;
    return options;
  }

  measurement::PredictedView predict(const measurement::SlabViews& measured, int view,
                                     const measurement::ViewModel& model) const {
    return measurement::predicted_views(*sampler_, projector_, measured, std::span(&view, 1),
                                        std::span(&model, 1))
        .front();
  }

  // Measures scale · A f + offset + noise. Every 13th pixel is no measurement and far off.
  std::unique_ptr<measurement::SlabViews> measure(double scale, double offset) const {
    const auto num_views = static_cast<std::size_t>(geometry_.num_views());
    const measurement::SlabViews::Shape shape{num_views, kWidth, kRows, 0, kRows};
    const auto empty = std::make_unique<measurement::SlabViews>(
        shape, 1.0, [](std::size_t, std::span<float>, std::span<std::uint8_t>) {}, "/tmp");
    return std::make_unique<measurement::SlabViews>(
        shape, 1.0,
        [&](std::size_t v, std::span<float> image, std::span<std::uint8_t> valid) {
          const auto clean = predict(*empty, static_cast<int>(v), {scale, offset, 1.0});
          base::Random random(7, v);
          for (std::size_t i = 0; i < image.size(); ++i) {
            valid[i] = i % 13 != 0;
            const double noise = sigma(static_cast<int>(v)) * random.normal();
            image[i] = valid[i] ? clean.predicted[i] + static_cast<float>(noise) : 1e4f;
          }
        },
        "/tmp");
  }
  static double sigma(int view) { return 0.1 * (1 + view); }

  measurement::ViewErrors error(const measurement::SlabViews& measured, bool fit_view_scale) const {
    std::vector<double> weights;
    for (int v = 0; v < geometry_.num_views(); ++v) weights.push_back(1 / (sigma(v) * sigma(v)));
    return measurement::held_out_error(*sampler_, projector_, measured, {1, 4}, weights,
                                       fit_view_scale);
  }

  geometry::TiltGeometry geometry_;
  Domain domain_;
  std::unique_ptr<field::Field> field_;
  projection::SlabProjector projector_;
  std::unique_ptr<projection::SlabSampler> sampler_;
};

// A view has 1772 rays: the mean of squares of standard normals is within 0.17 of 1 at five
// deviations.
TEST_F(KnownField, PredictsItsOwnViewsToTheNoise) {
  const auto measured = measure(1.0, 0.0);
  const measurement::ViewErrors e = error(*measured, false);
  EXPECT_NEAR(e.total, 1.0, 0.12);
  ASSERT_EQ(e.view_error.size(), 2u);
  for (const double view : e.view_error) EXPECT_NEAR(view, 1.0, 0.17);
  EXPECT_NEAR(e.total, (e.view_error[0] + e.view_error[1]) / 2, 1e-9);
  field_->parameters()[0] += 3.0f;
  for (float& value : field_->parameters()) value *= 0.9f;
  EXPECT_GT(error(*measured, false).total, e.total + 0.3) << "a wrong field predicts worse";
}

TEST_F(KnownField, ScaleAndOffsetOfAViewAreNoError) {
  const auto measured = measure(1.7, -3.0);
  const measurement::ViewErrors with = error(*measured, true);
  EXPECT_NEAR(with.total, 1.0, 0.12);
  for (const measurement::ViewModel& model : with.models) {
    EXPECT_NEAR(model.scale, 1.7, 0.1);
    EXPECT_NEAR(model.offset, -3.0, 1.0);
  }
  EXPECT_GT(error(*measured, false).total, 10 * with.total);
}

TEST_F(KnownField, PredictionsAreTheSameOnAnyNumberOfThreads) {
  const auto measured = measure(1.0, 0.0);
  const auto predict = [&](int threads) {
    base::set_thread_count(threads);
    auto view = this->predict(*measured, 4, {1.5, 2.0, 1.0});
    const measurement::ViewErrors errors = error(*measured, true);
    base::set_thread_count(0);
    return std::tuple(view.predicted, errors.total, errors.view_error);
  };
  EXPECT_EQ(predict(3), predict(1));
}

TEST_F(KnownField, MeasuredViewsAreShownAsTheyAre) {
  const auto measured = measure(1.0, 0.0);
  const measurement::PredictedView view = predict(*measured, 4, {1.0, 0.0, 1.0});
  ASSERT_EQ(view.measured.size(), static_cast<std::size_t>(kWidth * kRows));
  double squares = 0, count = 0;
  for (std::size_t i = 0; i < view.measured.size(); ++i) {
    EXPECT_EQ(std::isnan(view.measured[i]), i % 13 == 0) << i;
    if (i % 13 == 0) continue;
    const double residual = static_cast<double>(view.measured[i] - view.predicted[i]);
    squares += residual * residual;
    count += 1;
  }
  EXPECT_NEAR(squares / count / (sigma(4) * sigma(4)), error(*measured, false).view_error[1], 1e-3);
}

class FitWithHeldOut : public ::testing::Test {
 protected:
  using Series = testing::SphereSeries;

  // Fits spheres. The held-out views are multiplied by `gain`.
  std::unique_ptr<Fit> fit(double gain, int epochs) {
    base::set_thread_count(1);  // the work is too small for several
    const std::size_t num_views = Series().noise_sigma.size();
    Series::Options options;
    options.scale_of_view.assign(num_views, 1.0);
    const std::vector<int> held_out = {3, 11, 19};
    for (const int v : held_out) options.scale_of_view[static_cast<std::size_t>(v)] = gain;
    series_ = std::make_unique<Series>(options);
    measurement_ = {.geometry = series_->geometry,
                    .roi = {0, 0, Series::kWidth, Series::kRows},
                    .rays = series_->rays,
                    .noise_sigma = series_->noise_sigma,
                    .mean_density = 0.05,
                    .ray_geometry = {},
                    .held_out = held_out};
    FieldOptions field;
    field.kind = FieldKind::kGrid;
    field.leaf_size = 16;
    field.with_margin = false;
    fit_options_.epochs = epochs;
    fit_options_.subsets = 4;
    return std::make_unique<Fit>(measurement_, field, fit_options_);
  }
  static std::vector<float> parameters(const Fit& fit) {
    return {fit.field().parameters().begin(), fit.field().parameters().end()};
  }

  std::unique_ptr<Series> series_;
  measurement::Measurement measurement_;
  FitOptions fit_options_;
};

TEST_F(FitWithHeldOut, HeldOutViewsCarryNoLoss) {
  const auto run = [&](double gain) {
    auto f = fit(gain, 4);
    f->run([](const Fit&) { return true; });
    return std::pair(parameters(*f), f->progress().held_out_error);
  };
  const auto [plain, errors] = run(1.0);
  const auto [other, other_errors] = run(3.0);
  EXPECT_EQ(plain, other);
  ASSERT_EQ(errors.size(), 4u);
  EXPECT_LT(errors.back(), errors.front());
  EXPECT_GT(other_errors.back(), 2 * errors.back());
}

TEST_F(FitWithHeldOut, StopsOnceTheErrorNoLongerFalls) {
  fit_options_.patience = 2;
  auto f = fit(1.0, 100);
  EXPECT_FALSE(f->is_done());
  const auto set_errors = [&](std::vector<double> errors) {
    Progress progress = f->progress();
    progress.held_out_error = std::move(errors);
    f->go_on_from(std::move(progress), f->take_field());
  };
  set_errors({3.0, 1.0, 1.1});
  EXPECT_FALSE(f->is_done());
  set_errors({3.0, 1.0, 1.1, 1.2});
  EXPECT_TRUE(f->is_done());
  set_errors({3.0, 1.0, 1.1, 0.9});
  EXPECT_FALSE(f->is_done());
}

}  // namespace
}  // namespace tomofield::fit
