#include "baseline/classical/tv_reconstruction.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "base/enum_names.h"
#include "baseline/classical/slab_gradient.h"
#include "kernels/lanes.h"
#include "objective/terms.h"

namespace tomofield::baseline {
namespace {

using kernels::kLanes;
using projection::SampleSegment;

// κ below. The result does not depend on it, but the number of iterations does. A smaller value
// favours what the total variation alone decides (missing directions), a larger one the data.
// Values between 1.5 and 3 hardly differ on phantoms of 128 and 256 pixels, bounded and extended.
constexpr double kBalance = 2.0;

// The over-relaxation, below 2: 1.9 needs two thirds of the iterations of 1.
constexpr float kRelaxation = 1.9f;

// Over-relaxed densities swing from one iteration to the next. Scales and offsets of views that are
// fitted to each of them swing too, more and more. They are therefore fitted every tenth iteration.
constexpr int kViewFitInterval = 10;

// The weights of the concave penalty are computed first after three tenths of the iterations, then
// about eight times in all, evenly spread. Before, every weight is that of an edge of 1 τ, so that
// the densities behind the first weights are not too smooth.
constexpr int kReweightings = 8;
constexpr float kFirstWeight = 0.5f;

bool takes_weights_after(int iteration, const TvOptions& options) {
  if (options.penalty != Penalty::kConcave || iteration == 0) return false;
  const int first = options.iterations * 3 / 10;
  const int interval = std::max(1, (options.iterations - first) / kReweightings);
  return iteration >= first && iteration < options.iterations &&
         (iteration - first) % interval == 0;
}

// Returns the factors of κ λ h_x h_z ∇.
struct ScaledFactors {
  double scale;  // κ λ
  GradientFactors operator()(const SampleSegment& segment) const {
    const double area = scale * segment.hx * segment.hz;
    return {static_cast<float>(area / segment.hx), static_cast<float>(area),
            static_cast<float>(area / segment.hz)};
  }
};

// Returns Σ κ λ h_x h_z φ(|∇x|) of a row of K x; τ = 0 is the smooth penalty.
double penalty_of_row(const GradientRow& row, double tau) {
  // K x is κ λ h_x h_z ∇x. Its factor in y is the scale, because y has unit spacing.
  const float t = row.factors.y * static_cast<float>(tau);
  float sums[kLanes] = {};
  for (std::size_t at = 0; at < row.count; at += kLanes) {
    for (std::size_t l = 0; l < kLanes; ++l) {
      const std::size_t i = at + l;
      const float m = std::sqrt(row.x[i] * row.x[i] + row.y[i] * row.y[i] + row.z[i] * row.z[i]);
      sums[l] += t > 0 ? t * std::log(1 + m / t) : m;
    }
  }
  double sum = 0.0;
  for (const float of_lane : sums) sum += static_cast<double>(of_lane);
  return sum;
}

// Solves the saddle-point problem with rows K = (κ A / σ_view ; κ λ h_x h_z ∇) of like size:
//   min_x max_q,p  ⟨K x, (q, p)⟩ − κ² |q|² / 2 − κ ⟨q, b / σ⟩   with |p| <= w/κ, x >= 0.
// An iteration, with relaxation ρ and y = (q, p), is
//   y′ = prox(y + s K x);  y ← y + ρ (y′ − y);  x′ = prox(x − τ Kᵀ (2 y′ − y));  x ← x + ρ (x′ − x)
// The dual step is first, because it gives A x of the current x, and with it the objective, at no
// cost. Kᵀ is linear, so its extrapolation needs only Kᵀ y before and after.
class ChambollePock {
 public:
  ChambollePock(VoxelProblem& problem, const TvOptions& options, double start);

  // Takes the step of q and p. Returns λ Σ h_x h_z φ(|∇x|). Writes the sums of the data term of x,
  // one entry a pair.
  double step_duals(std::vector<std::vector<measurement::ViewSums>>& data_of_pair);
  // Takes the step of x. The last one is not relaxed, so that x >= 0 holds at the end.
  void step_densities(bool is_last);
  // Computes the weights w of the concave penalty from x.
  void take_weights();
  // Computes τ from the current scales of the views.
  void measure_steps();
  VoxelVolume& densities() { return x_; }

 private:
  void begin_concave_penalty();
  void step_ray_duals(const float* residuals, float* q_of_slab);
  double step_gradient_duals(int slab);
  void take_step(int slab, const float* adjoint, float relaxation);

  VoxelProblem& problem_;
  TvOptions options_;
  ScaledFactors factors_of_;
  ThreadScratch scratch_;
  VoxelVolume x_;        // densities
  VoxelVolume adjoint_;  // Kᵀ y of the last duals
  VoxelVolume px_, py_, pz_;
  double tau_of_penalty_ = 0;           // τ of φ in density units; 0: smooth
  std::optional<VoxelVolume> weights_;  // w; none: every weight is 1
  std::vector<base::AlignedBuffer<float>>
      q_;                   // κ q / σ_view, one buffer a pair: the residual / σ² at the optimum
  std::vector<float> tau_;  // steps of the densities [segment][z][x], the same in every row
};

ChambollePock::ChambollePock(VoxelProblem& problem, const TvOptions& options, double start)
    : problem_(problem),
      options_(options),
      factors_of_{kBalance * options.weight.value_or(options.usual_weight())},
      scratch_(problem),
      x_(problem.grid(), problem.num_rows()),
      adjoint_(problem.grid(), problem.num_rows()),
      px_(problem.grid(), problem.num_rows()),
      py_(problem.grid(), problem.num_rows()),
      pz_(problem.grid(), problem.num_rows()) {
  for (std::size_t pair = 0; pair < problem.num_pairs(); ++pair)
    q_.emplace_back(SlabPair::kMaxSlabs * problem.detector_size());
  measure_steps();
  x_.fill(static_cast<float>(options.non_negative ? std::max(0.0, start) : start));
  if (options.penalty == Penalty::kConcave) begin_concave_penalty();
}

void ChambollePock::begin_concave_penalty() {
  tau_of_penalty_ = objective::concavity(options_.concavity, problem_.noise_sigma());
  weights_.emplace(problem_.grid(), problem_.num_rows());
  for (int slab = 0; slab < problem_.num_slabs(); ++slab)
    std::fill_n(weights_->slab(slab), problem_.grid().size(), kFirstWeight);
}

// Computes τ, the inverse column sums of |K|. Masked rays count, so steps may be smaller than
// needed.
void ChambollePock::measure_steps() {
  float* detector = scratch_.detector();
  problem_.for_each_ray(problem_.views(), [&](const auto& model, float, std::size_t at) {
    std::fill_n(detector + at, kLanes,
                static_cast<float>(kBalance * model.scale * std::sqrt(model.weight)));
  });
  float* sums = scratch_.samples();
  problem_.backproject(problem_.views(), detector, sums);
  tau_.resize(problem_.grid().size() / kLanes);
  for_each_sample_row(problem_.grid(), [&](const SampleSegment& segment, std::ptrdiff_t row) {
    const GradientFactors k = factors_of_(segment);
    for (std::ptrdiff_t at = row; at < row + std::ptrdiff_t{segment.nx} * kLanes; at += kLanes)
      tau_[static_cast<std::size_t>(at / kLanes)] = 1.0f / (sums[at] + 2 * (k.x + k.y + k.z));
  });
}

double ChambollePock::step_duals(std::vector<std::vector<measurement::ViewSums>>& data_of_pair) {
  return sum_over_pairs(problem_.num_slabs(), [&](const SlabPair& pair) {
    float *residuals = scratch_.detector(), *q = q_[pair.index()].data();
    data_of_pair[pair.index()] =
        problem_.residuals(pair, problem_.views(), x_.slab(pair.first), residuals);
    double penalty = 0.0;
    for (int slab = pair.first; slab < pair.end(); ++slab) {
      step_ray_duals(residuals, q);
      penalty += step_gradient_duals(slab);
      residuals += problem_.detector_size();
      q += problem_.detector_size();
    }
    return penalty;
  });
}

void ChambollePock::step_ray_duals(const float* residuals, float* q_of_slab) {
  problem_.for_each_ray(problem_.views(), [&](const auto& model, float length, std::size_t at) {
    // A of this view is scaled, and so are its row sums, the residuals and q.
    const double per_sigma = std::sqrt(model.weight);
    const double step = kBalance / (model.scale * static_cast<double>(length));
    const float rate = static_cast<float>(step * per_sigma);
    const float shrink = static_cast<float>(1.0 / (1.0 + step / per_sigma));
    for (std::size_t i = at; i < at + kLanes; ++i) {
      float& q = q_of_slab[i];
      q += kRelaxation * (shrink * (q + rate * residuals[i]) - q);
    }
  });
}

// Returns λ Σ h_x h_z φ(|∇x|) of the slab.
double ChambollePock::step_gradient_duals(int slab) {
  thread_local std::vector<float> ones;
  double penalty = 0.0;
  for_each_gradient_row(x_, slab, factors_of_, [&](const GradientRow& g) {
    penalty += penalty_of_row(g, tau_of_penalty_);
    ones.resize(std::max(ones.size(), g.count), 1.0f);
    const float* weight = weights_ ? weights_->slab(slab) + g.row : ones.data();
    const float step = 0.5f / std::max({g.factors.x, g.factors.y, g.factors.z});
    float *px = px_.slab(slab) + g.row, *py = py_.slab(slab) + g.row, *pz = pz_.slab(slab) + g.row;
    for (std::size_t i = 0; i < g.count; ++i) {
      const float x = px[i] + step * g.x[i], y = py[i] + step * g.y[i], z = pz[i] + step * g.z[i];
      const float radius = weight[i] * static_cast<float>(1.0 / kBalance);
      const float inside = radius / std::max(radius, std::sqrt(x * x + y * y + z * z));
      px[i] += kRelaxation * (inside * x - px[i]);
      py[i] += kRelaxation * (inside * y - py[i]);
      pz[i] += kRelaxation * (inside * z - pz[i]);
    }
  });
  return penalty / kBalance;
}

void ChambollePock::take_weights() {
  base::parallel_for("step sizes", problem_.num_slabs(), [&](std::int64_t index) {
    const int slab = static_cast<int>(index);
    for_each_gradient_row(x_, slab, factors_of_, [&](const GradientRow& g) {
      const float t = g.factors.y * static_cast<float>(tau_of_penalty_);
      float* weight = weights_->slab(slab) + g.row;
      for (std::size_t i = 0; i < g.count; ++i) {
        const float m = std::sqrt(g.x[i] * g.x[i] + g.y[i] * g.y[i] + g.z[i] * g.z[i]);
        weight[i] = t / (t + m);
      }
    });
  });
}

void ChambollePock::step_densities(bool is_last) {
  for_each_pair(problem_.num_slabs(), [&](const SlabPair& pair) {
    float* adjoint = scratch_.samples();
    problem_.backproject(problem_.views(), q_[pair.index()].data(), adjoint, pair.count);
    for (int slab = pair.first; slab < pair.end(); ++slab, adjoint += problem_.grid().size()) {
      add_gradient_adjoint(px_, py_, pz_, slab, factors_of_, adjoint);
      take_step(slab, adjoint, is_last ? 1.0f : kRelaxation);
    }
  });
}

void ChambollePock::take_step(int slab, const float* adjoint, float relaxation) {
  const float lowest = options_.non_negative ? 0.0f : std::numeric_limits<float>::lowest();
  float *x = x_.slab(slab), *last = adjoint_.slab(slab);
  for_each_sample_row(problem_.grid(), [&](const SampleSegment& segment, std::ptrdiff_t row) {
    for (std::ptrdiff_t at = row; at < row + std::ptrdiff_t{segment.nx} * kLanes; at += kLanes) {
      const float tau = tau_[static_cast<std::size_t>(at / kLanes)];
      for (std::ptrdiff_t i = at; i < at + kLanes; ++i) {
        const float ahead = last[i] + (2 / kRelaxation) * (adjoint[i] - last[i]);
        x[i] += relaxation * (std::max(lowest, x[i] - tau * ahead) - x[i]);
        last[i] = adjoint[i];
      }
    }
  });
}

}  // namespace

Solution reconstruct_tv(VoxelProblem& problem, const TvOptions& options, double start,
                        const AfterIteration& after_iteration) {
  ChambollePock solver(problem, options, start);
  std::vector<std::vector<measurement::ViewSums>> data_of_pair(problem.num_pairs());
  std::vector<double> data_loss, objective;
  for (int iteration = 0;; ++iteration) {
    const double variation = solver.step_duals(data_of_pair);
    const std::vector<measurement::ViewSums> data = total(data_of_pair);
    data_loss.push_back(problem.data_loss(data));
    objective.push_back(data_loss.back() + variation);
    if (iteration == options.iterations) break;
    solver.step_densities(iteration + 1 == options.iterations);
    if (takes_weights_after(iteration + 1, options)) solver.take_weights();
    if (problem.fits_view_models() && (iteration + 1) % kViewFitInterval == 0) {
      problem.fit_view_models(data);
      solver.measure_steps();
    }
    after_iteration({iteration + 1, data_loss.back(), objective.back()}, solver.densities());
  }
  return {std::move(solver.densities()), std::move(data_loss), std::move(objective)};
}

}  // namespace tomofield::baseline
