#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "distributed/communicator.h"
#include "geometry/tilt_geometry.h"
#include "geometry/view_correction.h"
#include "measurement/measurement.h"
#include "tilt_series/image.h"
#include "tilt_series/tilt_series.h"
#include "tomofield/options.h"

namespace tomofield::measurement {

/// Returns every fault of what a user says of the specimen, a sentence each.
std::vector<std::string> faults_of(const SpecimenOptions& specimen);

/// Returns everything of the measurement that follows from the series' geometry; it has no rays.
/// Throws Error for options that do not fit the series.
Measurement plan_measurement(const tilt_series::PlannedSeries& series,
                             const SpecimenOptions& specimen);

/// Returns the bytes that reading the views takes at most, besides what is kept of them: those that
/// are decoded at once, and the buffers from which slabs are filled.
std::size_t decoding_memory(
    const tilt_series::PlannedSeries& series, const Measurement& plan,
    const distributed::Communicator& processes = distributed::Communicator::alone());

/// Turns a series into rays in density units. The stored pixels of the series' views are given up
/// (TiltSeries::forget_view). `scratch_dir` takes the rays if they do not fit in memory.
/// `transfers` become those of the measurement (view_transfers.h); with a contrast transfer, the
/// fringes of masked beads are subtracted from the views.
Measurement prepare_measurement(const tilt_series::TiltSeries& series,
                                const SpecimenOptions& specimen,
                                const std::filesystem::path& scratch_dir,
                                std::vector<microscope::ViewTransfer> transfers = {});

/// Does the same on each of the processes that share a series. They get the same but for `rays`:
/// each holds those of its share (row_share.h) of bands of `band_rows` rows.
Measurement prepare_measurement(const tilt_series::TiltSeries& series,
                                const SpecimenOptions& specimen,
                                const std::filesystem::path& scratch_dir, std::int64_t band_rows,
                                const distributed::Communicator& processes,
                                std::vector<microscope::ViewTransfer> transfers = {});

/// Reads a view of a series that is not resampled, and aligns it with a correction.
tilt_series::MaskedImage read_aligned(const tilt_series::TiltSeries& recorded, std::size_t view,
                                      const geometry::ViewCorrection& correction);

/// Returns everything but the rays of a series that is not resampled, as if its views were
/// resampled as its files align them. realign() reads the rays.
Measurement plan_realigned(const tilt_series::TiltSeries& recorded, const SpecimenOptions& specimen,
                           const distributed::Communicator& processes);

/// Reads the rays of such a measurement, or reads them again, each view with a correction of its
/// alignment. The density unit stays, and so do the stored pixels of the views. With
/// `bin` above 1, the rays are nearly the means over squares of bin × bin pixels
/// (Measurement::rays_bin): that is much less work, and all that binned() with this bin needs.
void realign(const tilt_series::TiltSeries& recorded,
             std::span<const geometry::ViewCorrection> corrections, int bin,
             const std::filesystem::path& scratch_dir, std::int64_t band_rows,
             const distributed::Communicator& processes, Measurement& measurement);

}  // namespace tomofield::measurement
