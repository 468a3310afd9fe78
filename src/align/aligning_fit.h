#pragma once

#include <cstdint>

#include "align/registration.h"
#include "fit/options.h"
#include "fit/stages.h"
#include "measurement/held_out.h"
#include "measurement/measurement.h"

namespace tomofield::align {

/// Returns the options of a field of plain vertices that serves to align views, like the field of a
/// reconstruction in all else.
fit::FieldOptions aligning_field(fit::FieldOptions field);

/// Returns the options of a fit that serves to align views. The field is stiff, because a soft one
/// blurs until it explains wrong shifts.
fit::FitOptions aligning_fit(int coarse_epochs, int fine_epochs, std::uint64_t seed);

/// Returns a view and its prediction by a fit in one of its stages, with their place in the aligned
/// view.
ImagePair image_pair(const measurement::PredictedView& view,
                     const measurement::Measurement& measurement, const fit::Stage& stage);

}  // namespace tomofield::align
