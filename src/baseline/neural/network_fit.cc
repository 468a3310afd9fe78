#include "baseline/neural/network_fit.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "base/random.h"
#include "base/threads/parallel.h"
#include "baseline/neural/network_density.h"
#include "kernels/adam.h"
#include "kernels/lanes.h"

namespace tomofield::baseline {
namespace {

constexpr std::size_t kBlock = 64;            // parameters that share the count of their steps
constexpr std::size_t kBlocksOfThread = 256;  // blocks that a thread takes at once

constexpr double kRateFall = 0.1;   // factor of the learning rate over all steps
constexpr double kNoiseRate = 0.1;  // rate of the noise levels; it falls by the same factor

NetworkDensity::Shape shape_of(const NetworkOptions& options, double mean_density) {
  return {options.hidden_layers, options.width, options.activation,
          options.non_negative,  mean_density,  options.seed};
}

class NetworkFit {
 public:
  NetworkFit(VoxelProblem& problem, const NetworkOptions& options,
             std::unique_ptr<PointEncoding> encoding, double mean_density, bool learns_noise)
      : problem_(problem),
        options_(options),
        density_(problem.grid(), problem.num_rows(), std::move(encoding),
                 shape_of(options, mean_density)),
        adam_(density_.num_parameters()),
        solution_{VoxelVolume(problem.grid(), problem.num_rows()), {}, {}, {}},
        detector_(problem.detector_size()),
        gradient_(problem.grid().size()),
        row_sets_(RowSet::all(problem.num_rows())),
        sums_(row_sets_.size()) {
    if (learns_noise) noise_.emplace(sigma_of_views());
  }

  Solution run(const AfterIteration& after_iteration) {
    for (int iteration = 0; iteration < options_.iterations; ++iteration) {
      const base::Random random(options_.seed, static_cast<std::uint64_t>(iteration) + 1);
      for (const std::size_t set : base::shuffled(row_sets_.size(), random)) take_step(set);
      finish_pass();
      after_iteration({iteration + 1, solution_.data_loss.back(), solution_.objective.back()},
                      solution_.densities);
    }
    for (std::size_t set = 0; set < row_sets_.size(); ++set) find_residuals(set);
    finish_pass();
    if (noise_) solution_.noise_sigma = sigma_of_views();
    return std::move(solution_);
  }

 private:
  // The number of residuals of each view and the sum of their squares.
  struct Squares {
    std::vector<double> counts, sums;
  };
  Squares squares_of(const std::vector<measurement::ViewSums>& sums) const {
    Squares squares;
    for (std::size_t v = 0; v < sums.size(); ++v) {
      squares.counts.push_back(sums[v].n);
      squares.sums.push_back(sums[v].squared_residual(problem_.view_model(problem_.views()[v])));
    }
    return squares;
  }

  std::vector<double> sigma_of_views() const {
    std::vector<double> sigma;
    for (std::size_t v = 0; v < problem_.views().size(); ++v) {
      const auto view = static_cast<std::size_t>(problem_.views()[v]);
      sigma.push_back(noise_ ? noise_->sigma(v) : problem_.noise_sigma()[view]);
    }
    return sigma;
  }

  // Computes the densities and the residuals of a set of rows from the current parameters.
  void find_residuals(std::size_t set) {
    const RowSet& rows = row_sets_[set];
    float* samples = solution_.densities.slab(rows.slab);
    density_.decode(rows, samples);
    sums_[set] =
        problem_.residuals({rows.slab}, problem_.views(), samples, detector_.data(), rows.lanes());
  }

  void take_step(std::size_t set) {
    find_residuals(set);
    float* rays = detector_.data();
    const std::int64_t rays_of_view = problem_.width() * kernels::kLanes;
    for (const double sigma : sigma_of_views()) {
      const float weight = static_cast<float>(1 / (sigma * sigma));
      for (std::int64_t i = 0; i < rays_of_view; ++i) *rays++ *= weight;
    }
    problem_.backproject(problem_.views(), detector_.data(), gradient_.data());
    density_.accumulate(row_sets_[set], gradient_.data(), adam_.gradient());
    const double all_steps =
        static_cast<double>(options_.iterations) * static_cast<double>(row_sets_.size());
    const double fall = std::pow(kRateFall, static_cast<double>(num_steps_) / all_steps);
    ++num_steps_;
    adam_.step(options_.learning_rate * fall, density_.parameters());
    if (!noise_) return;
    const Squares squares = squares_of(sums_[set]);
    noise_->step(squares.counts, squares.sums, kNoiseRate * fall);
  }

  // Ends a pass with the sums of all rows. Each set contributes its sums from the moment of its
  // step.
  void finish_pass() {
    const std::vector<measurement::ViewSums> all = total(sums_);
    solution_.data_loss.push_back(problem_.data_loss(all));
    const Squares squares = squares_of(all);
    solution_.objective.push_back(noise_ ? noise_->objective(squares.counts, squares.sums)
                                         : solution_.data_loss.back());
    problem_.fit_view_models(all);
  }

  VoxelProblem& problem_;
  const NetworkOptions& options_;
  NetworkDensity density_;
  LazyAdam adam_;
  std::optional<NoiseLevels> noise_;
  Solution solution_;
  base::AlignedBuffer<float> detector_, gradient_;
  std::vector<RowSet> row_sets_;
  std::vector<std::vector<measurement::ViewSums>> sums_;  // [set of rows][view]
  std::int64_t num_steps_ = 0;
};

}  // namespace

double NoiseLevels::sigma(std::size_t view) const {
  return start_[view] * std::exp(log_ratio_[view]);
}

void NoiseLevels::step(std::span<const double> counts, std::span<const double> squares,
                       double rate) {
  constexpr double kMaxExcess = 2.0;  // residuals far above their level must not make it overshoot
  for (std::size_t v = 0; v < start_.size(); ++v) {
    if (counts[v] == 0) continue;
    const double excess = squares[v] / (counts[v] * sigma(v) * sigma(v)) - 1;
    log_ratio_[v] += rate / 2 * std::min(excess, kMaxExcess);
  }
}

double NoiseLevels::objective(std::span<const double> counts,
                              std::span<const double> squares) const {
  double sum = 0;
  for (std::size_t v = 0; v < start_.size(); ++v)
    sum += squares[v] / (2 * sigma(v) * sigma(v)) + counts[v] * log_ratio_[v];
  return sum;
}

LazyAdam::LazyAdam(std::size_t num_parameters)
    : gradient_(num_parameters),
      m_(num_parameters),
      v_(num_parameters),
      steps_((num_parameters + kBlock - 1) / kBlock) {}

void LazyAdam::step(double learning_rate, std::span<float> parameters) {
  const std::size_t parts = (steps_.size() + kBlocksOfThread - 1) / kBlocksOfThread;
  base::parallel_for("sum gradients", static_cast<std::int64_t>(parts), [&](std::int64_t part) {
    const std::size_t first = static_cast<std::size_t>(part) * kBlocksOfThread;
    const std::size_t end = std::min(first + kBlocksOfThread, steps_.size());
    for (std::size_t b = first; b < end; ++b) step_block(b, learning_rate, parameters);
  });
}

void LazyAdam::step_block(std::size_t block, double learning_rate, std::span<float> parameters) {
  const std::size_t first = block * kBlock;
  const std::size_t count = std::min(kBlock, gradient_.size() - first);
  const std::span<float> gradient = std::span(gradient_).subspan(first, count);
  if (std::ranges::all_of(gradient, [](float g) { return g == 0.0f; })) return;
  const kernels::AdamStep usual;
  const kernels::AdamStep step =
      kernels::corrected_step(usual.beta1, usual.beta2, learning_rate, ++steps_[block]);
  kernels::adam_step(step, static_cast<std::ptrdiff_t>(count), parameters.data() + first,
                     gradient.data(), m_.data() + first, v_.data() + first);
}

MethodSize network_size(const projection::SampleGrid& grid, std::int64_t num_rows,
                        const PointEncoding& encoding, const NetworkOptions& options) {
  constexpr std::size_t kOfAdam = 3 * sizeof(float);  // gradient and two moments
  MethodSize size =
      NetworkDensity::size(grid, num_rows, encoding, shape_of(options, 0), base::thread_count());
  size.bytes += kOfAdam * size.num_parameters;
  return size;
}

Solution fit_network(VoxelProblem& problem, const NetworkOptions& options,
                     std::unique_ptr<PointEncoding> encoding, double mean_density,
                     bool learns_noise, const AfterIteration& after_iteration) {
  return NetworkFit(problem, options, std::move(encoding), mean_density, learns_noise)
      .run(after_iteration);
}

}  // namespace tomofield::baseline
