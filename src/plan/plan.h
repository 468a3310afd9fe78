#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "distributed/communicator.h"
#include "fit/stages.h"
#include "options/run_options.h"
#include "plan/tile_plan.h"
#include "tilt_series/planned_series.h"
#include "tomofield/options.h"

namespace tomofield::plan {

/// Says what a run will do. Lengths are pixels of the binned views.
struct RunPlan {
  int num_views = 0;
  std::int64_t view_width = 0, view_height = 0;
  double pixel_size_A = 0;  ///< of the binned views
  Rectangle roi;
  double thickness = 0;
  int num_leaves = 0;              ///< at the start
  bool has_large_leaves = false;   ///< a root cell reaches beyond the region along both axes
  int most_vertices = 0;           ///< along an axis of a leaf
  std::size_t num_parameters = 0;  ///< max. during the last stage
  int num_trials = 0;              ///< expected number of short fits that choose settings
  bool has_too_few_views_for_trials = false;  ///< which would else choose settings
  std::vector<fit::Stage> stages;
  int steps_an_epoch = 0;
  std::int64_t num_steps = 0;    ///< of all stages of a fit
  int num_fits = 1;              ///< 3 with halves, one after the other
  TilePlan tiles;                ///< by which the region is fitted, if they are used
  std::size_t memory_bytes = 0;  ///< estimated peak of each process
};

/// Plans a run. It writes nothing and allocates neither views nor parameters. Throws Error for
/// options that do not fit the series or the number of processes.
RunPlan plan_run(const tilt_series::PlannedSeries& series,
                 const options::ReconstructOptions& options,
                 const distributed::Communicator& processes = distributed::Communicator::alone());

/// Throws Error if this machine has less memory than a run needs.
void require_memory(const RunPlan& plan, const distributed::Communicator& processes =
                                             distributed::Communicator::alone());

/// Returns plan_run(), and throws Error also as require_memory() and require_few_vertices() do.
RunPlan require_possible_run(
    const tilt_series::PlannedSeries& series, const options::ReconstructOptions& options,
    const distributed::Communicator& processes = distributed::Communicator::alone());

/// Checks a run before its views are read, which takes long: throws Error as require_possible_run()
/// does, and, before an alignment, require_disk(). Reads no view. Every process calls it.
void check_before_reading(
    const options::ReconstructOptions& options,
    const distributed::Communicator& processes = distributed::Communicator::alone());

/// Does the same for an alignment without a reconstruction: throws Error if there are too few views
/// or too little memory.
void check_alignment_alone(const options::ReconstructOptions& options);

/// Throws Error if a leaf would have more vertices along an axis than one can have.
void require_few_vertices(const RunPlan& plan);

}  // namespace tomofield::plan
