#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>

#include "align/registration.h"
#include "fit/fit.h"
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

/// Says how local motion is registered in a stage.
LocalRegistrationOptions local_options(const measurement::Measurement& measurement,
                                       const fit::Stage& stage);

/// Predicts all views by a fit in one of its stages, as many at a time as fit into a gigabyte, and
/// calls visit(view, images) for each of them, from several threads. Every process calls it.
void for_each_prediction(const fit::Fit& fit, const measurement::Measurement& measurement,
                         const fit::Stage& stage,
                         const std::function<void(std::size_t, const ImagePair&)>& visit);

/// Says whether an alignment is updated after an epoch of a stage, of which `epochs_done` of all
/// stages are done. The first epochs show too little of the specimen. At the end of a stage the fit
/// is already in the next one, unless it is done.
bool is_update_due(const fit::Stage& stage, std::int64_t epochs_done, bool is_done);

}  // namespace tomofield::align
