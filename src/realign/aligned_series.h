#pragma once

#include "distributed/communicator.h"
#include "options/run_options.h"
#include "tune/tuning.h"

namespace tomofield::realign {

/// Aligns the views of a run with the field itself, if the options ask for it (align/alignment.h),
/// and puts what it found into the options: the corrections of the views, the sections that cannot
/// be aligned, and the record for the metrics. Writes the record as NAME_align.json
/// (align/alignment_record.h). A resumed run takes it from there. Returns false if a stop was
/// requested. Every process calls it. Throws Error for a series of too few views, and for a record
/// that is damaged or of another series.
bool align_series(options::ReconstructOptions& options, const tune::TuneHooks& hooks,
                  const distributed::Communicator& processes);

}  // namespace tomofield::realign
