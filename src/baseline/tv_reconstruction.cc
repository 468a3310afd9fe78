#include "baseline/tv_reconstruction.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "baseline/slab_gradient.h"
#include "kernels/lanes.h"

namespace tomofield::baseline {
namespace {

using kernels::kLanes;
using projection::SampleSegment;

// κ below: the result does not depend on it, the number of iterations does. Smaller favours
// what the total variation decides alone (missing directions), larger the data. Between 1.5 and
// 3 hardly differ on phantoms of 128 and 256 pixels, bounded and extended.
constexpr double kBalance = 2.0;

// Over-relaxation, below 2: 1.9 needs two thirds of the iterations of 1.
constexpr float kRelaxation = 1.9f;

// The saddle-point problem, in rows K = (κ A / σ_view ; κ λ h_x h_z ∇) of like size:
//   min_x max_q,p  ⟨K x, (q, p)⟩ − κ² |q|² / 2 − κ ⟨q, b / σ⟩   with |p| <= 1/κ, x >= 0.
// An iteration, with relaxation ρ and y = (q, p):
//   y′ = prox(y + s K x);  y ← y + ρ (y′ − y);  x′ = prox(x − τ Kᵀ (2 y′ − y));  x ← x + ρ (x′ − x)
// Dual first, so that A x of the current x, and with it the objective, comes for
// free; Kᵀ is linear, so its extrapolation needs Kᵀ y before and after alone.
class ChambollePock {
 public:
  ChambollePock(VoxelProblem& problem, const TvOptions& options, double start);

  // The step of q and p. Returns λ Σ h_x h_z |∇x| and, each slab's, the sums of the data term of x.
  double step_duals(std::vector<std::vector<loss::ViewSums>>& data_of_slab);
  // The step of x. The last one is not relaxed: it ends where x >= 0 holds.
  void step_densities(bool is_last);
  VoxelVolume& densities() { return x_; }

 private:
  void measure_steps();
  GradientFactors factors(const SampleSegment& segment) const;
  void step_ray_duals(int slab, const float* residuals);
  double step_gradient_duals(int slab);
  void add_gradient_adjoint(int slab, float* samples) const;
  void take_step(int slab, const float* adjoint, float relaxation);

  VoxelProblem& problem_;
  TvOptions options_;
  ThreadScratch scratch_;
  VoxelVolume x_;        // densities
  VoxelVolume adjoint_;  // Kᵀ y of the last duals
  VoxelVolume px_, py_, pz_;
  std::vector<base::AlignedBuffer<float>>
      q_;                   // κ q / σ_view, one buffer a slab: the residual / σ² at the optimum
  std::vector<float> tau_;  // steps of the densities [segment][z][x], the same in every row
};

ChambollePock::ChambollePock(VoxelProblem& problem, const TvOptions& options, double start)
    : problem_(problem),
      options_(options),
      scratch_(problem.detector_size(), problem.grid().size()),
      x_(problem.grid(), problem.num_rows()),
      adjoint_(problem.grid(), problem.num_rows()),
      px_(problem.grid(), problem.num_rows()),
      py_(problem.grid(), problem.num_rows()),
      pz_(problem.grid(), problem.num_rows()) {
  for (int slab = 0; slab < problem.num_slabs(); ++slab) q_.emplace_back(problem.detector_size());
  measure_steps();
  const float density = static_cast<float>(options.non_negative ? std::max(0.0, start) : start);
  base::parallel_for(problem.num_slabs(), [&](std::int64_t slab) {
    const int s = static_cast<int>(slab);
    for_each_sample_row(problem.grid(), [&](const SampleSegment& segment, std::ptrdiff_t row) {
      for (std::ptrdiff_t i = 0; i < segment.nx; ++i)
        std::fill_n(x_.slab(s) + row + i * kLanes, x_.rows_in_slab(s), density);
    });
  });
}

GradientFactors ChambollePock::factors(const SampleSegment& segment) const {
  const double scale = kBalance * options_.weight * segment.hx * segment.hz;
  return {static_cast<float>(scale / segment.hx), static_cast<float>(scale),
          static_cast<float>(scale / segment.hz)};
}

// τ, the inverse column sums of |K|. Masked rays are counted: steps may be smaller than need be.
void ChambollePock::measure_steps() {
  float* detector = scratch_.detector();
  for (const int view : problem_.views()) {
    const double row_scale = kBalance * std::sqrt(problem_.view_model(view).weight);
    std::fill_n(detector + view * problem_.width() * kLanes, problem_.width() * kLanes,
                static_cast<float>(row_scale));
  }
  float* sums = scratch_.cleared_samples();
  problem_.backproject(detector, sums);
  tau_.resize(problem_.grid().size() / kLanes);
  for_each_sample_row(problem_.grid(), [&](const SampleSegment& segment, std::ptrdiff_t row) {
    const GradientFactors k = factors(segment);
    for (std::ptrdiff_t at = row; at < row + std::ptrdiff_t{segment.nx} * kLanes; at += kLanes)
      tau_[static_cast<std::size_t>(at / kLanes)] = 1.0f / (sums[at] + 2 * (k.x + k.y + k.z));
  });
}

double ChambollePock::step_duals(std::vector<std::vector<loss::ViewSums>>& data_of_slab) {
  return sum_over_slabs(problem_.num_slabs(), [&](int slab) {
    float* residuals = scratch_.detector();
    data_of_slab[static_cast<std::size_t>(slab)] =
        problem_.residuals(slab, x_.slab(slab), residuals);
    step_ray_duals(slab, residuals);
    return step_gradient_duals(slab);
  });
}

void ChambollePock::step_ray_duals(int slab, const float* residuals) {
  float* q = q_[static_cast<std::size_t>(slab)].data();
  for (const int view : problem_.views()) {
    const loss::ViewModel& model = problem_.view_model(view);
    // A of this view is scaled, so its row sums are too, and residuals carry the scale once.
    const double per_sigma = std::sqrt(model.weight);
    const double scaled = kBalance / (model.scale * model.scale);
    for (std::int64_t x = 0; x < problem_.width(); ++x) {
      const std::int64_t ray = view * problem_.width() + x;
      const double step =
          scaled / static_cast<double>(problem_.ray_lengths()[static_cast<std::size_t>(ray)]);
      const float rate = static_cast<float>(step * per_sigma);
      const float shrink = static_cast<float>(1.0 / (1.0 + step / per_sigma));
      for (int l = 0; l < kLanes; ++l) {
        const std::int64_t i = ray * kLanes + l;
        q[i] += kRelaxation * (shrink * (q[i] + rate * residuals[i]) - q[i]);
      }
    }
  }
}

// Returns λ Σ h_x h_z |∇x| of the slab.
double ChambollePock::step_gradient_duals(int slab) {
  const float* above = slab + 1 < problem_.num_slabs() ? x_.slab(slab + 1) : nullptr;
  const float radius = static_cast<float>(1.0 / kBalance);
  thread_local std::vector<float> gradient;
  double variation = 0.0;
  for (const SampleSegment& segment : problem_.grid().segments()) {
    const std::size_t count = static_cast<std::size_t>(segment.nx) * kLanes;
    gradient.resize(3 * count);
    float *gx = gradient.data(), *gy = gx + count, *gz = gy + count;
    const GradientFactors k = factors(segment);
    const float step = 0.5f / std::max({k.x, k.y, k.z});
    for (int z = 0; z < segment.nz; ++z) {
      gradient_of_row(segment, z, x_.rows_in_slab(slab), k, x_.slab(slab), above, gx, gy, gz);
      const std::ptrdiff_t row = segment.origin + z * segment.stride_z();
      float *px = px_.slab(slab) + row, *py = py_.slab(slab) + row, *pz = pz_.slab(slab) + row;
      float sums[kLanes] = {};
      for (std::size_t at = 0; at < count; at += kLanes) {
        for (std::size_t l = 0; l < kLanes; ++l) {
          const std::size_t i = at + l;
          sums[l] += std::sqrt(gx[i] * gx[i] + gy[i] * gy[i] + gz[i] * gz[i]);
          const float x = px[i] + step * gx[i], y = py[i] + step * gy[i], z1 = pz[i] + step * gz[i];
          const float inside = radius / std::max(radius, std::sqrt(x * x + y * y + z1 * z1));
          px[i] += kRelaxation * (inside * x - px[i]);
          py[i] += kRelaxation * (inside * y - py[i]);
          pz[i] += kRelaxation * (inside * z1 - pz[i]);
        }
      }
      for (const float sum : sums) variation += static_cast<double>(sum);
    }
  }
  return variation / kBalance;
}

void ChambollePock::step_densities(bool is_last) {
  base::parallel_for(problem_.num_slabs(), [&](std::int64_t index) {
    const int slab = static_cast<int>(index);
    float* adjoint = scratch_.cleared_samples();
    problem_.backproject(q_[static_cast<std::size_t>(slab)].data(), adjoint);
    add_gradient_adjoint(slab, adjoint);
    take_step(slab, adjoint, is_last ? 1.0f : kRelaxation);
  });
}

void ChambollePock::add_gradient_adjoint(int slab, float* samples) const {
  const float* below = slab > 0 ? py_.slab(slab - 1) : nullptr;
  for (const SampleSegment& segment : problem_.grid().segments()) {
    const GradientFactors k = factors(segment);
    for (int z = 0; z < segment.nz; ++z)
      add_gradient_adjoint_of_row(segment, z, k, px_.slab(slab), py_.slab(slab), pz_.slab(slab),
                                  below, samples);
  }
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
  std::vector<std::vector<loss::ViewSums>> data_of_slab(
      static_cast<std::size_t>(problem.num_slabs()));
  std::vector<double> data_loss, objective;
  for (int iteration = 0;; ++iteration) {
    const double variation = solver.step_duals(data_of_slab);
    const std::vector<loss::ViewSums> data = total(data_of_slab);
    data_loss.push_back(problem.data_loss(data));
    objective.push_back(data_loss.back() + variation);
    if (iteration == options.iterations) break;
    solver.step_densities(iteration + 1 == options.iterations);
    if (options.fit_view_scale) problem.fit_view_models(data);
    after_iteration({iteration + 1, data_loss.back(), objective.back()}, solver.densities());
  }
  return {std::move(solver.densities()), std::move(data_loss), std::move(objective)};
}

}  // namespace tomofield::baseline
