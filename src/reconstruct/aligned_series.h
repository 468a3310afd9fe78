#pragma once

#include <cstddef>

#include "distributed/communicator.h"
#include "reconstruct/options.h"
#include "reconstruct/reconstruct.h"

namespace tomofield::reconstruction {

/// An alignment is judged by views that it holds out, so it needs some.
constexpr std::size_t kFewestViewsToAlign = 12;
/// Throws Error if there are fewer.
void require_views_to_align(std::size_t num_views);

/// Aligns the views of a run with the field itself, if the options ask for it (align/alignment.h),
/// and puts what it found into the options: the corrections of the views, the sections that cannot
/// be aligned, and the record for the metrics. Writes the record as NAME_align.json
/// (alignment_record.h). A resumed run takes it from there. ReconstructHooks::tune_progress
/// receives the progress. Returns false if a stop was requested. Every process calls it. Throws
/// Error for a series of too few views, and for a record that is damaged or of another series.
bool align_series(ReconstructOptions& options, const ReconstructHooks& hooks,
                  const distributed::Communicator& processes);

}  // namespace tomofield::reconstruction
