#pragma once

#include <cstddef>
#include <vector>

#include "distributed/communicator.h"
#include "fit/domain.h"
#include "fit/stages.h"
#include "measurement/measurement.h"
#include "options/run_options.h"
#include "tilt_series/planned_series.h"

namespace tomofield::plan {

/// The resident part of the program and its libraries (measured: 24 MiB of files, 3 MiB of heap).
constexpr std::size_t kProgramBytes = std::size_t{28} << 20;

/// A fit whose memory is wanted. `plan` has no rays.
struct PlannedFit {
  const tilt_series::PlannedSeries& series;
  const measurement::Measurement& plan;
  const fit::Domain& domain;
  const options::ReconstructOptions& options;
  const distributed::Communicator& processes;
};

/// Returns the peak memory of a process in a fit with these stages.
std::size_t estimate_memory(const PlannedFit& planned, const std::vector<fit::Stage>& stages);

/// Returns the bytes of a thread: the vertices of a leaf, and later a part of the volume.
std::size_t thread_memory(const measurement::Measurement& plan, const fit::Domain& domain);

/// Returns the bytes of the vertices of one leaf a thread, of the largest leaves.
std::size_t leaves_of_threads(const fit::Domain& domain);

/// Returns the bytes of the bands of a fit of `num_rows` rows that are worked on at a time: their
/// slabs, and the views of a step.
std::size_t bands_memory(const measurement::Measurement& plan, const fit::Domain& domain,
                         const FitOptions& options, std::int64_t num_rows);

int num_fitted_views(const measurement::Measurement& plan, const FitOptions& options);
int steps_an_epoch(const measurement::Measurement& plan, const FitOptions& options);

/// Returns the number of parameters as a field of this kind. An adaptive tree counts with all
/// leaves that its budget allows.
std::size_t max_parameters(const fit::Domain& domain, const FieldOptions& options, FieldKind kind);

/// Returns the bytes of the parameters of this process as a field of this kind.
double parameter_bytes(const fit::Domain& domain, const FieldOptions& options, FieldKind kind,
                       const distributed::Communicator& processes);

/// Returns the bytes of the parameters of this process, of their gradient and of two moments, in
/// the stage that takes the most. While an adaptive tree changes, all but the gradient are there
/// twice.
double fitted_bytes(const fit::Domain& domain, const std::vector<fit::Stage>& stages,
                    const FieldOptions& options, const distributed::Communicator& processes);

}  // namespace tomofield::plan
