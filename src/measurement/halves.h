#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "distributed/communicator.h"
#include "measurement/measurement.h"
#include "measurement/view_residuals.h"
#include "tilt_series/half_stacks.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::measurement {

/// The noise of a view of half of the frames, over that of all of them in the same units.
inline constexpr double kNoiseOfHalfFrames = 1.4142135623730951;

/// Measures one half of the frames of a prepared series (TiltSeries::read_half()). Everything but
/// the rays and the noise is that of `whole`; also which rays count, and the background that was
/// subtracted. Each process gets the same slabs as in prepare_measurement(). Every process calls
/// it.
Measurement half_of_frames(
    const tilt_series::TiltSeries& series, tilt_series::Half half, const Measurement& whole,
    const std::filesystem::path& scratch_dir, std::int64_t band_rows,
    const distributed::Communicator& processes = distributed::Communicator::alone());

/// Returns the measurement in which one half of the fitted views is left out. In order of tilt,
/// odd views are the first, the third and so on; even ones are the others. The rays are shared.
Measurement half_of_tilts(tilt_series::Half half, const Measurement& whole);

/// Turns models of the views of all frames into those of a half of the frames, whose noise is
/// larger.
std::vector<ViewModel> with_noise_of_half_frames(std::vector<ViewModel> models);

}  // namespace tomofield::measurement
