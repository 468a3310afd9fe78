#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "base/aligned_buffer.h"
#include "base/threads/parallel.h"
#include "baseline/voxel_problem.h"
#include "baseline/voxel_volume.h"

namespace tomofield::baseline {

/// The name of a method and what it holds besides its own scratch space.
struct MethodFacts {
  const char* name;
  int iterations;                  ///< passes over the views
  int volumes;                     ///< volumes held at once, with the densities
  int detectors;                   ///< detectors of a slab held at once, with the measured rays
  int buffers = 1;                 ///< buffers of a pair of slabs in each thread
  const char* memory_advice = "";  ///< its options that save memory, as the end of a sentence
};

/// The size of a method for a series: what it fits, and the memory besides the volumes and
/// detectors.
struct MethodSize {
  std::size_t num_parameters;
  std::size_t bytes;
};

/// The result of a reconstruction. The histories of iterative methods have one entry for the
/// starting densities and one for the densities after each iteration.
struct Solution {
  VoxelVolume densities;
  std::vector<double> data_loss;  ///< ½ Σ (residual / σ)²
  std::vector<double> objective;  ///< the minimised sum
  /// The noise of the fitted views, in density units times pixels, if the method learns it.
  std::vector<double> noise_sigma = {};
};

/// The report of a finished iteration. Its losses are those of the densities that it began with.
struct IterationReport {
  int iteration = 0;  ///< 1 is the first
  double data_loss = 0.0;
  double objective = 0.0;
};

/// Called after every iteration with the densities at its end. It may write their padding.
using AfterIteration = std::function<void(const IterationReport&, VoxelVolume&)>;

/// The rays of a pair of slabs and some buffers of its samples for each thread of
/// base::parallel_for.
class ThreadScratch {
 public:
  /// Makes room for the fitted views and one buffer.
  explicit ThreadScratch(const VoxelProblem& problem)
      : ThreadScratch(problem, problem.views().size(), 1) {}
  ThreadScratch(const VoxelProblem& problem, std::size_t num_views, std::size_t num_buffers)
      : num_buffers_(num_buffers) {
    const std::size_t threads = static_cast<std::size_t>(base::thread_count());
    for (std::size_t i = 0; i < threads; ++i)
      detectors_.emplace_back(SlabPair::kMaxSlabs * problem.projector().detector_size(num_views));
    for (std::size_t i = 0; i < threads * num_buffers; ++i)
      samples_.emplace_back(SlabPair::kMaxSlabs * problem.grid().size());
  }
  float* detector() { return detectors_[thread()].data(); }
  /// Returns a buffer with what its last user left in it.
  float* samples(std::size_t buffer = 0) {
    return samples_[thread() * num_buffers_ + buffer].data();
  }

 private:
  static std::size_t thread() { return static_cast<std::size_t>(base::thread_index()); }
  std::size_t num_buffers_;
  std::vector<base::AlignedBuffer<float>> detectors_, samples_;  // [thread], [thread, buffer]
};

}  // namespace tomofield::baseline
