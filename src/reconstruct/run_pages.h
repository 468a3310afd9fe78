#pragma once

#include "io/saving/output_set.h"
#include "reconstruct/results.h"
#include "reconstruct/run.h"

namespace tomofield::reconstruction {

/// Writes what people and other programs look at beside the volume of a run: pictures, descriptions
/// of the volume for other programs, and the report, which shows the pictures. `outputs` has the
/// volume already. Notes the pictures in `result`. The root alone calls it.
void write_pages(const Run& run, const io::OutputSet& outputs, RunResult& result);

}  // namespace tomofield::reconstruction
