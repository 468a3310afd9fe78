#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "base/aligned_buffer.h"
#include "base/parallel.h"
#include "baseline/voxel_problem.h"
#include "baseline/voxel_volume.h"

namespace tomofield::baseline {

/// What a method is called and what it needs besides its own scratch space.
struct MethodFacts {
  const char* name;
  int iterations;   ///< passes over the views
  int volumes;      ///< held at once, the densities among them
  int detectors;    ///< held at once, of all views of a slab, the measured rays among them
  int buffers = 1;  ///< of a pair of slabs, that each thread has
  const char* memory_advice = "";  ///< what of its own options takes less, as the end of a sentence
};

/// How much of it a method needs for a series: what it fits, and the memory that it takes besides
/// the volumes and detectors.
struct MethodSize {
  std::size_t num_parameters;
  std::size_t bytes;
};

/// What a reconstruction ends with. The histories of iterative ones have one entry for
/// the starting densities and one for the densities after each iteration.
struct Solution {
  VoxelVolume densities;
  std::vector<double> data_loss;  ///< ½ Σ (residual / σ)²
  std::vector<double> objective;  ///< what is minimised
  /// Of the fitted views, in density units times pixels, if the method learns it.
  std::vector<double> noise_sigma = {};
};

/// By how much the objective fell in the last tenth of the iterations, as a fraction of it; none of
/// a method that does not iterate.
std::optional<double> last_decrease(const Solution& solution);

/// An iteration that is done; the figures are those of the densities that it began with.
struct IterationReport {
  int iteration = 0;  ///< 1 is the first
  double data_loss = 0.0;
  double objective = 0.0;
};

/// Called after every iteration, with the densities that it ended with, of which it may write the
/// padding.
using AfterIteration = std::function<void(const IterationReport&, VoxelVolume&)>;

/// The rays of a pair of slabs and some buffers of its samples for each thread of
/// base::parallel_for.
class ThreadScratch {
 public:
  /// For the views that are fitted.
  explicit ThreadScratch(const VoxelProblem& problem)
      : ThreadScratch(problem, problem.views().size(), 1) {}
  ThreadScratch(const VoxelProblem& problem, std::size_t num_views, std::size_t num_buffers)
      : num_buffers_(num_buffers) {
    const std::size_t threads = static_cast<std::size_t>(base::thread_count());
    for (std::size_t i = 0; i < threads; ++i)
      detectors_.emplace_back(SlabPair::kMost * problem.projector().detector_size(num_views));
    for (std::size_t i = 0; i < threads * num_buffers; ++i)
      samples_.emplace_back(SlabPair::kMost * problem.grid().size());
  }
  float* detector() { return detectors_[thread()].data(); }
  /// As they were left.
  float* samples(std::size_t buffer = 0) {
    return samples_[thread() * num_buffers_ + buffer].data();
  }

 private:
  static std::size_t thread() { return static_cast<std::size_t>(base::thread_index()); }
  std::size_t num_buffers_;
  std::vector<base::AlignedBuffer<float>> detectors_, samples_;  // [thread], [thread, buffer]
};

}  // namespace tomofield::baseline
