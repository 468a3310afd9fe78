#include "objective/slab_objective.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "central_difference.h"
#include "fit/domain.h"
#include "kernels/lanes.h"
#include "objective/slab_data_term.h"
#include "objective/total_variation.h"
#include "random_arrays.h"

namespace tomofield::objective {
namespace {

using field::Region;
using kernels::kLanes;
using measurement::SlabViews;
using projection::SampleGrid;
using projection::SampleSegment;
using projection::SlabProjector;
using projection::SlabSampler;

constexpr std::int64_t kWidth = 21, kRows = 58;  // slabs 0, 1 | 2 and 10 rows of 3
constexpr double kThickness = 9.5;

geometry::TiltGeometry tilted_geometry() {
  auto g = geometry::centred_geometry(kWidth, kRows, kThickness, {-62, -30, 0, 25, 45, 58});
  g.hand = -1;
  g.axis_x += 0.3;
  return g;
}

// Returns random images with some pixels that do not count.
std::unique_ptr<SlabViews> random_views(int num_views) {
  const SlabViews::Shape shape{.num_views = static_cast<std::size_t>(num_views),
                               .width = kWidth,
                               .height = kRows,
                               .first_row = 0,
                               .num_rows = kRows};
  const auto read = [](std::size_t v, std::span<float> image, std::span<std::uint8_t> valid) {
    const auto values = testing::random_floats(image.size(), 50 + v, 0, 10);
    std::copy(values.begin(), values.end(), image.begin());
    for (std::size_t i = 0; i < valid.size(); ++i) valid[i] = (i * 7 + v) % 11 != 0;
  };
  return std::make_unique<SlabViews>(shape, 1.0, read, "/tmp");
}

std::vector<measurement::ViewModel> random_models(int num_views) {
  base::Random random(2);
  std::vector<measurement::ViewModel> models;
  for (int v = 0; v < num_views; ++v) {
    models.push_back(
        {random.uniform(0.8, 1.2), random.uniform(-0.5, 0.5), random.uniform(0.005, 0.02)});
  }
  return models;
}

// The weights of the variations and their penalty.
struct Weights {
  double density_variation = 0.0, factor_variation = 0.0;
  kernels::VariationPenalty penalty;
};

// Returns a seed whose first step takes forward differences, as the reference below does.
std::uint64_t seed_of_forward_differences() {
  std::uint64_t seed = 1;
  for (;; ++seed) {
    const DifferenceSides sides = difference_sides(seed, 0);
    if (!sides.backward_x && !sides.backward_z) return seed;
  }
}

// Holds everything an objective needs, and evaluates it.
class Problem {
 public:
  Problem(std::unique_ptr<field::Field> field, SampleGrid grid, const Weights& weights)
      : geometry_(tilted_geometry()),
        field_(std::move(field)),
        rays_(random_views(geometry_.num_views())),
        models_(random_models(geometry_.num_views())),
        weights_(weights),
        projector_(geometry_, grid),
        sampler_(*field_, grid, 0, kRows) {
    measured_.geometry = geometry_;
    measured_.rays = rays_;
  }

  struct Result {
    double data = 0, variation = 0, grad_bias = 0;
    std::vector<float> gradient;
  };
  Result evaluate() const {
    std::vector<std::unique_ptr<Term>> terms;
    terms.push_back(std::make_unique<SlabDataTerm>(*rays_));
    terms.push_back(std::make_unique<DensityVariation>(weights_.density_variation, weights_.penalty,
                                                       seed_of_forward_differences()));
    terms.push_back(
        std::make_unique<FactorVariation>(*field_, weights_.factor_variation, weights_.penalty));
    const FitOptions options;
    const SlabObjective objective({.field = *field_,
                                   .projector = projector_,
                                   .measured = measured_,
                                   .full = measured_,
                                   .num_rows = kRows,
                                   .support = {},
                                   .share = {{0, sampler_.num_bands()}},
                                   .own_leaves = {0, field_->tree().num_leaves()},
                                   .options = options},
                                  std::move(terms));
    const Step step{.views = kViews, .models = models_, .multiplicity = kMultiplicity};
    Result result;
    result.gradient.resize(field_->num_parameters());
    std::vector<measurement::ViewSums> view_sums(models_.size());
    const SlabObjective::Sums sums =
        objective.add(step, result.gradient.data(), view_sums, [](int) {});
    for (const SlabObjective::PairSums& pair : sums.pairs) {
      for (std::size_t v = 0; v < kViews.size(); ++v) {
        const measurement::ViewModel& m = models_[static_cast<std::size_t>(kViews[v])];
        result.data += kMultiplicity * m.weight / 2 * pair.views[v].squared_residual(m);
      }
      for (const TermValue& term : pair.terms) result.variation += term.value;
      result.grad_bias += pair.grad_bias;
    }
    for (const std::vector<TermValue>& band : sums.bands)
      for (const TermValue& term : band) result.variation += term.value;
    return result;
  }

  // Returns the data loss, written out in double from decoded samples and predicted rays.
  double data_loss() const {
    const SampleGrid& grid = projector_.grid();
    double loss = 0;
    for (int slab = 0; slab < sampler_.num_slabs(); ++slab) {
      std::vector<float> samples(grid.size()), rays(projector_.detector_size(kViews.size()));
      sampler_.decode(slab, samples.data());
      projector_.forward(samples.data(), kViews, rays.data());
      const float* p = rays.data();
      for (const int v : kViews) {
        const measurement::ViewModel& m = models_[static_cast<std::size_t>(v)];
        const float* b = rays_->rays(slab, v);
        for (std::int64_t x = 0; x < kWidth; ++x) {
          for (int l = 0; l < kLanes; ++l, ++p, ++b) {
            const double r = m.scale * static_cast<double>(*p) + m.offset - static_cast<double>(*b);
            if (rays_->mask(slab, v)[x] >> l & 1) loss += kMultiplicity * m.weight / 2 * r * r;
          }
        }
      }
    }
    return loss;
  }

  double variation() const {
    double sum = 0;
    for (std::size_t s = 0; s < projector_.grid().segments().size(); ++s) sum += variation_of(s);
    if (weights_.factor_variation > 0) {
      std::vector<float> ignored(field_->num_parameters());
      for (int leaf = 0; leaf < field_->tree().num_leaves(); ++leaf) {
        sum += field_->parameter_variation(leaf, weights_.penalty, weights_.factor_variation,
                                           ignored.data());
      }
    }
    return sum;
  }

  field::Field& field() { return *field_; }

  // Returns the derivative of data_loss() + variation() by one float.
  double derivative(float& parameter) const {
    return testing::central_difference(parameter, 4e-3f, [&] { return data_loss() + variation(); });
  }

 private:
  static constexpr double kMultiplicity = 1.5;
  inline static const std::vector<int> kViews = {5, 0, 2, 4};  // a subset, in any order

  double penalty(double square) const {
    const double epsilon = static_cast<double>(weights_.penalty.epsilon);
    const double tau = static_cast<double>(weights_.penalty.concavity);
    const double m = std::sqrt(square + epsilon * epsilon);
    return tau > 0 ? tau * std::log1p(m / tau) : m;
  }

  // Returns the variation of a segment as one volume [row][z][x], without slabs.
  double variation_of(std::size_t segment) const {
    const SampleSegment& s = projector_.grid().segments()[segment];
    const auto nx = static_cast<std::size_t>(s.nx), nz = static_cast<std::size_t>(s.nz);
    std::vector<double> f;
    for (int slab = 0; slab < sampler_.num_slabs(); ++slab) {
      std::vector<float> samples(projector_.grid().size());
      sampler_.decode(slab, samples.data());
      for (int l = 0; l < sampler_.rows_in_slab(slab); ++l) {
        for (int k = 0; k < s.nz; ++k) {
          for (int i = 0; i < s.nx; ++i) {
            f.push_back(static_cast<double>(
                samples[static_cast<std::size_t>(s.origin + k * s.stride_z() + i * kLanes + l)]));
          }
        }
      }
    }
    double sum = 0;
    for (std::size_t y = 0; y < kRows; ++y) {
      for (std::size_t k = 0; k < nz; ++k) {
        for (std::size_t i = 0; i < nx; ++i) {
          const std::size_t at = (y * nz + k) * nx + i;
          const double dx = i + 1 < nx ? (f[at + 1] - f[at]) / s.hx : 0;
          const double dz = k + 1 < nz ? (f[at + nx] - f[at]) / s.hz : 0;
          const double dy = y + 1 < kRows ? f[at + nz * nx] - f[at] : 0;
          sum += penalty(dx * dx + dy * dy + dz * dz);
        }
      }
    }
    return weights_.density_variation * s.hx * s.hz * sum;
  }

  geometry::TiltGeometry geometry_;
  std::unique_ptr<field::Field> field_;
  std::shared_ptr<const SlabViews> rays_;
  measurement::Measurement measured_;
  std::vector<measurement::ViewModel> models_;
  Weights weights_;
  SlabProjector projector_;
  SlabSampler sampler_;
};

// Returns weights of penalties whose curvature is small at the scale of the finite differences.
Weights weights_of(double density, double factor, double concavity) {
  Weights w;
  w.density_variation = density;
  w.factor_variation = factor;
  w.penalty = {.epsilon = 0.2f, .concavity = static_cast<float>(concavity)};
  return w;
}

Problem random_problem(FieldKind kind, const Weights& weights) {
  FieldOptions options;
  options.kind = kind;
  options.leaf_size = 16;  // cells of 32 rows: two bands, with margin cells on both sides
  options.vertex_spacing = 2;
  options.rank = 3;
  const fit::FieldStart start{.sharpness = 3, .initial_scale = kind == FieldKind::kVm ? 0.7 : 1.0};
  const fit::Domain domain = fit::make_domain(tilted_geometry(), {0, 0, kWidth, kRows}, options);
  return {fit::make_initial_field(domain, kThickness, 0.5, options, 3, {}, start), domain.grid,
          weights};
}

struct Kind {
  const char* name;
  FieldKind field;
  double density_variation, factor_variation, concavity;
};

class WholeObjective : public ::testing::TestWithParam<Kind> {
 protected:
  Problem problem() const {
    const Kind& k = GetParam();
    return random_problem(k.field,
                          weights_of(k.density_variation, k.factor_variation, k.concavity));
  }
};
INSTANTIATE_TEST_SUITE_P(Kinds, WholeObjective,
                         ::testing::Values(Kind{"grid_data", FieldKind::kGrid, 0, 0, 0},
                                           Kind{"grid_smooth", FieldKind::kGrid, 0.4, 0, 0},
                                           Kind{"grid_concave", FieldKind::kGrid, 0.4, 0, 0.3},
                                           Kind{"grid_factors", FieldKind::kGrid, 0, 0.3, 0.3},
                                           Kind{"vm_data", FieldKind::kVm, 0, 0, 0},
                                           Kind{"vm_smooth", FieldKind::kVm, 0.4, 0.3, 0},
                                           Kind{"vm_concave", FieldKind::kVm, 0.4, 0.3, 0.3}),
                         [](const auto& k) { return std::string(k.param.name); });

TEST_P(WholeObjective, ValueIsThatOfTheWholeVolume) {
  const Problem p = problem();
  const auto result = p.evaluate();
  const double data = p.data_loss(), variation = p.variation();
  EXPECT_NEAR(result.data, data, 1e-5 * data);
  EXPECT_NEAR(result.variation, variation, 1e-5 * variation);
  EXPECT_GT(data, 10.0);
}

TEST_P(WholeObjective, GradientIsTheDerivative) {
  Problem p = problem();
  const auto result = p.evaluate();
  field::Field& field = p.field();
  double largest = 0;
  for (const float g : result.gradient)
    largest = std::max(largest, std::abs(static_cast<double>(g)));
  base::Random random(17);
  for (int n = 0; n < 60; ++n) {
    const int leaf = n % field.tree().num_leaves();
    std::size_t at = field.offset(leaf) + random.below(field.offset(leaf + 1) - field.offset(leaf));
    // Every second parameter of the grid is at the first or the last row of a leaf: V [nx, nz, ny].
    if (field.kind() == FieldKind::kGrid && n % 2 == 1) {
      const auto ny = static_cast<std::size_t>(field.shape(leaf).ny);
      at = field.offset(leaf) + (at - field.offset(leaf)) / ny * ny + (n % 4 == 1 ? 0 : ny - 1);
    }
    const double expected = p.derivative(field.parameters()[at]);
    EXPECT_NEAR(result.gradient[at], expected, 1e-3 * std::abs(expected) + 3e-4 * largest)
        << "leaf " << leaf << " parameter " << at - field.offset(leaf);
  }
  const double bias = p.derivative(field.bias);
  EXPECT_NEAR(result.grad_bias, bias, 1e-3 * std::abs(bias));
}

// Returns the same leaves as two bands of root cells of 32 px, or as one band of 64 px. The
// grouping of slabs must not change any result.
std::unique_ptr<field::Field> field_of_cells(std::int64_t cell_size) {
  const int cells = static_cast<int>(128 / cell_size);
  const field::RootGrid roots{
      .x0 = -64, .y0 = 0, .cell_size = cell_size, .columns = cells, .rows = cells / 2};
  field::Quadtree tree(
      roots, std::vector<Region>(static_cast<std::size_t>(cells * cells / 2), Region::kInterest));
  tree.split_to_level(Region::kInterest, cell_size == 64 ? 1 : 0);
  const std::vector<field::LeafShape> shapes(static_cast<std::size_t>(tree.num_leaves()),
                                             {.nx = 9, .ny = 17, .nz = 5});
  auto field = field::make_field(FieldKind::kGrid, std::move(tree), kThickness, shapes);
  field->activation = {3.0f};
  for (int leaf = 0; leaf < field->tree().num_leaves(); ++leaf) {
    const field::Square& square = field->tree().leaf(leaf).square;
    const auto values = testing::random_floats(
        field->offset(1), static_cast<std::uint64_t>(square.x0 * 7 + square.y0 + 999));
    std::copy(values.begin(), values.end(),
              field->parameters().begin() + static_cast<std::ptrdiff_t>(field->offset(leaf)));
  }
  return field;
}

TEST(SlabObjective, BandsLeaveNoSeam) {
  const SampleGrid grid = projection::make_sample_grid(tilted_geometry(), 0, kWidth, 2);
  for (const double concavity : {0.0, 0.3}) {
    const Weights weights = weights_of(0.4, 0.2, concavity);
    Problem two(field_of_cells(32), grid, weights), one(field_of_cells(64), grid, weights);
    const auto a = two.evaluate(), b = one.evaluate();
    EXPECT_NEAR(a.data, b.data, 1e-9 * b.data);
    EXPECT_NEAR(a.variation, b.variation, 1e-6 * b.variation);
    EXPECT_NEAR(a.grad_bias, b.grad_bias, 1e-6 * std::abs(b.grad_bias));
    double largest = 0;
    for (const float g : b.gradient) largest = std::max(largest, std::abs(static_cast<double>(g)));
    for (int leaf = 0; leaf < two.field().tree().num_leaves(); ++leaf) {
      const field::Square& square = two.field().tree().leaf(leaf).square;
      const int same = one.field().tree().find_leaf(static_cast<double>(square.x0) + 0.5,
                                                    static_cast<double>(square.y0) + 0.5);
      for (std::size_t i = 0; i < two.field().offset(1); ++i) {
        ASSERT_NEAR(a.gradient[two.field().offset(leaf) + i],
                    b.gradient[one.field().offset(same) + i], 2e-6 * largest)
            << "leaf at " << square.x0 << ", " << square.y0 << " parameter " << i;
      }
    }
  }
}

TEST(DensityVariation, StepsTakeDifferencesToEverySide) {
  std::set<std::pair<bool, bool>> seen;
  for (std::int64_t step = 0; step < 40; ++step) {
    const DifferenceSides sides = difference_sides(1, step);
    seen.emplace(sides.backward_x, sides.backward_z);
  }
  EXPECT_EQ(seen.size(), 4u);
}

TEST(SlabObjective, ThreadsChangeNoBit) {
  const SampleGrid grid = projection::make_sample_grid(tilted_geometry(), 0, kWidth, 2);
  const Weights weights = weights_of(0.4, 0.3, 0.3);
  const Problem factors = random_problem(FieldKind::kVm, weights);
  const Problem high_leaves(field_of_cells(64), grid, weights);
  for (const Problem* p : {&factors, &high_leaves}) {
    base::set_thread_count(1);
    const Problem::Result alone = p->evaluate();
    for (const int threads : {2, 3, 8}) {
      base::set_thread_count(threads);
      const Problem::Result together = p->evaluate();
      EXPECT_EQ(together.gradient, alone.gradient) << threads << " threads";
      EXPECT_EQ(together.grad_bias, alone.grad_bias) << threads << " threads";
      EXPECT_EQ(together.data, alone.data) << threads << " threads";
    }
    base::set_thread_count(0);
  }
}

}  // namespace
}  // namespace tomofield::objective
