#include "measurement/surrogate_views.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "base/random.h"

namespace tomofield::measurement {
namespace {

constexpr std::int64_t kWidth = 24, kHeight = 20;

std::vector<float> random_image(std::uint64_t stream) {
  base::Random random(5, stream);
  std::vector<float> image(kWidth * kHeight);
  for (float& value : image) value = static_cast<float>(random.uniform(-1.0, 1.0));
  return image;
}

microscope::ViewTransfer transfer_of(double defocus_A) {
  microscope::ViewTransfer transfer;
  transfer.defocus = {defocus_A + 500, defocus_A - 500, 30.0, 0.0};
  transfer.slope.x_A = 200.0;
  transfer.exposure = 10.0;
  transfer.pixel_size_A = 10.0;
  return transfer;
}

// Two views of which some pixels do not count, and what is predicted of them.
struct Scene {
  DataFilters filters;
  std::vector<PredictedView> predicted;
  std::unique_ptr<SlabViews> rays;
  std::vector<ViewModel> models{{1.2, 0.3, 4.0}, {0.8, -0.1, 9.0}};
  std::vector<int> views{0, 1};

  Scene() {
    for (const int view : views) {
      filters.transfers.emplace_back(kWidth, kHeight, transfer_of(20000.0 + 3000.0 * view));
      predicted.push_back({.width = kWidth,
                           .height = kHeight,
                           .measured = random_image(static_cast<std::uint64_t>(10 + view)),
                           .predicted = random_image(static_cast<std::uint64_t>(20 + view))});
      for (std::size_t i = 0; i < 70; ++i)
        predicted.back().measured[5 * i + 3] = std::numeric_limits<float>::quiet_NaN();
    }
    const auto read = [&](std::size_t view, std::span<float> image, std::span<std::uint8_t> valid) {
      for (std::size_t i = 0; i < image.size(); ++i) {
        const float value = predicted[view].measured[i];
        valid[i] = std::isnan(value) ? 0 : 1;
        image[i] = valid[i] ? value : 0.0f;
      }
    };
    rays = std::make_unique<SlabViews>(SlabViews::Shape{views.size(), kWidth, kHeight, 0, kHeight},
                                       1.0, read, "");
  }

  SurrogateViews surrogates() const {
    SurrogateViews surrogates(*rays, views, models);
    surrogates.set(filters, views, predicted, distributed::Communicator::alone());
    return surrogates;
  }

  // Returns the model of a view with the offset that suits a filtered projection best.
  ViewModel fitted_model(std::size_t view, const PredictedView& filtered) const {
    ViewModel model = models[view];
    model.offset = mean_offset(sums_of(filtered, model), model);
    return model;
  }

  // Returns the smallest ½ w Σ |a H p + o − d|² for any o, over the pixels of a view that count.
  double loss(std::size_t view, const std::vector<float>& projection) const {
    PredictedView filtered = predicted[view];
    filtered.predicted = filters.transfers[view].apply(projection);
    const ViewModel model = fitted_model(view, filtered);
    return model.weight / 2 * sums_of(filtered, model).squared_residual(model);
  }
};

// Returns ½ w Σ |p − d′|² of a surrogate.
double surrogate_loss(const SurrogateViews& surrogates, int view, const std::vector<float>& p) {
  double squares = 0;
  for (std::int64_t y = 0; y < kHeight; ++y)
    for (std::int64_t x = 0; x < kWidth; ++x)
      squares += std::pow(static_cast<double>(p[static_cast<std::size_t>(y * kWidth + x)]) -
                              static_cast<double>(surrogates.rays().ray(view, x, y)),
                          2);
  return surrogates.models()[static_cast<std::size_t>(view)].weight / 2 * squares;
}

TEST(SurrogateViews, HaveTheGradientOfTheFilteredViews) {
  const Scene scene;
  const SurrogateViews surrogates = scene.surrogates();
  for (int view = 0; view < 2; ++view) {
    const auto v = static_cast<std::size_t>(view);
    const std::vector<float> direction = random_image(40 + v);
    std::vector<float> low = scene.predicted[v].predicted, high = low;
    for (std::size_t i = 0; i < low.size(); ++i) {
      low[i] -= 0.1f * direction[i];
      high[i] += 0.1f * direction[i];
    }
    // Both are quadratic, so central differences are exact.
    const double exact = scene.loss(v, high) - scene.loss(v, low);
    const double found =
        surrogate_loss(surrogates, view, high) - surrogate_loss(surrogates, view, low);
    EXPECT_NEAR(found, exact, 1e-4 * std::abs(exact));
  }
}

TEST(SurrogateViews, AreNowhereBelowTheLossOfTheFilteredViews) {
  const Scene scene;
  const SurrogateViews surrogates = scene.surrogates();
  for (std::size_t v = 0; v < 2; ++v) {
    const std::vector<float>& here = scene.predicted[v].predicted;
    for (std::uint64_t trial = 0; trial < 20; ++trial) {
      std::vector<float> there = random_image(100 + trial);
      const double rise = scene.loss(v, there) - scene.loss(v, here);
      const int view = static_cast<int>(v);
      EXPECT_LE(rise, surrogate_loss(surrogates, view, there) -
                          surrogate_loss(surrogates, view, here) + 1e-3);
    }
  }
}

// Returns how far a surrogate is from the projection at most.
double largest_change(const Scene& scene, const SurrogateViews& surrogates) {
  double largest = 0;
  for (std::int64_t y = 0; y < kHeight; ++y)
    for (std::int64_t x = 0; x < kWidth; ++x) {
      const float p = scene.predicted[0].predicted[static_cast<std::size_t>(y * kWidth + x)];
      largest =
          std::max(largest, static_cast<double>(std::abs(surrogates.rays().ray(0, x, y) - p)));
    }
  return largest;
}

TEST(SurrogateViews, LimitResidualsAndTellTheSumsOfTheMeasuredPixels) {
  Scene scene;
  scene.models[0].largest_residual = 0.05;
  const SurrogateViews surrogates = scene.surrogates();
  EXPECT_EQ(surrogates.sums(0).n, kWidth * kHeight - 70);
  EXPECT_LE(surrogates.sums(0).limited_squares, 0.05 * 0.05 * surrogates.sums(0).n);
  for (std::int64_t y = 0; y < kHeight; ++y)
    for (std::int64_t x = 0; x < kWidth; ++x) EXPECT_TRUE(surrogates.rays().counts(0, x, y));
  const double limited = largest_change(scene, surrogates);
  scene.models[0].largest_residual = std::numeric_limits<double>::infinity();
  EXPECT_GT(largest_change(scene, scene.surrogates()), 2 * limited);
}

TEST(SurrogateViews, FollowTheModelOfTheView) {
  const Scene scene;
  const SurrogateViews surrogates = scene.surrogates();
  EXPECT_EQ(surrogates.models()[0].scale, 1.0);
  EXPECT_EQ(surrogates.models()[0].offset, 0.0);
  const double largest = scene.filters.transfers[0].largest_transfer(0.0, std::numbers::sqrt2 / 2);
  EXPECT_NEAR(surrogates.models()[0].weight, 4.0 * 1.2 * 1.2 * 1.1 * largest * largest, 1e-9);
}

// The mean of a view is far larger than its noise, and the transfer passes 0.07 of a projection's.
TEST(SurrogateViews, DoNotDependOnTheMeanOfAViewThatTheTransferTakesAway) {
  Scene scene;
  const SurrogateViews plain = scene.surrogates();
  for (float& value : scene.predicted[0].measured) value += 3.0f;
  scene.models[0].offset = -7.0;
  const SurrogateViews brighter = scene.surrogates();
  for (std::int64_t y = 0; y < kHeight; ++y)
    for (std::int64_t x = 0; x < kWidth; ++x)
      ASSERT_NEAR(brighter.rays().ray(0, x, y), plain.rays().ray(0, x, y), 1e-5);
  EXPECT_NEAR(brighter.sums(0).limited_squares, plain.sums(0).limited_squares, 1e-3);
}

TEST(SurrogateViews, TakeLongerStepsForViewsThatTransferLess) {
  Scene scene;
  microscope::ViewTransfer late = transfer_of(20000.0);
  late.exposure = 150.0;
  scene.filters.transfers[1] = microscope::ViewFilter(kWidth, kHeight, late);
  scene.models[1] = scene.models[0];
  const SurrogateViews surrogates = scene.surrogates();
  EXPECT_LT(surrogates.models()[1].weight, 0.5 * surrogates.models()[0].weight);
}

// The step to a surrogate is (a / L) Hᵀ W r, and the weight of the view is w L.
TEST(SurrogateViews, WeightFrequenciesByTheNoise) {
  Scene scene;
  scene.filters.noise.emplace(kWidth, kHeight);
  const SurrogateViews surrogates = scene.surrogates();
  for (std::size_t v = 0; v < 2; ++v) {
    const PredictedView& view = scene.predicted[v];
    PredictedView seen = view;
    seen.predicted = scene.filters.transfers[v].apply(view.predicted);
    const std::vector<float>& filtered = seen.predicted;
    const ViewModel model = scene.fitted_model(v, seen);
    std::vector<float> residual(filtered.size());
    for (std::size_t i = 0; i < residual.size(); ++i)
      if (!std::isnan(view.measured[i]))
        residual[i] = static_cast<float>(static_cast<double>(view.measured[i]) - model.offset -
                                         model.scale * static_cast<double>(filtered[i]));
    scene.filters.noise->weigh(residual);
    for (std::size_t i = 0; i < residual.size(); ++i)
      if (std::isnan(view.measured[i])) residual[i] = 0.0f;
    const std::vector<float> step = scene.filters.transfers[v].apply_transpose(residual);
    const int place = static_cast<int>(v);
    const double bound = surrogates.models()[v].weight / model.weight;  // a² L
    for (std::int64_t y = 0; y < kHeight; ++y)
      for (std::int64_t x = 0; x < kWidth; ++x) {
        const auto i = static_cast<std::size_t>(y * kWidth + x);
        const double change = static_cast<double>(surrogates.rays().ray(place, x, y)) -
                              static_cast<double>(view.predicted[i]);
        EXPECT_NEAR(change, model.scale / bound * static_cast<double>(step[i]), 1e-5);
      }
  }
}

TEST(SurrogateViews, OfColouredNoiseAloneNeedNoTransfer) {
  Scene scene;
  scene.filters.transfers.clear();
  scene.filters.noise.emplace(kWidth, kHeight);
  const SurrogateViews surrogates = scene.surrogates();
  EXPECT_GE(surrogates.models()[0].weight, 4.0 * 1.2 * 1.2 * 0.9);
  EXPECT_EQ(surrogates.sums(0).n, kWidth * kHeight - 70);
}

}  // namespace
}  // namespace tomofield::measurement
