#pragma once

#include <optional>
#include <string>

#include "distributed/communicator.h"
#include "measurement/measurement.h"
#include "options/run_options.h"
#include "tune/tuning.h"

// What a stored fit was made from. A fit continues only if it has the same origin.
namespace tomofield::checkpoint {

struct FitOrigin {
  std::string fingerprint;              ///< fingerprint_of() its series and options
  std::optional<tune::TunedFit> tuned;  ///< the trials that chose some of its options
  /// Rows of the tiles that it is fitted by; 0: the whole region. None: without --budget.
  std::optional<int> tile_rows = {};
  bool are_tile_rows_given = false;  ///< by --tile-rows: the memory that was free did not decide
};

/// Returns the fingerprint of a fit (JSON): the options, the geometry and a checksum of the rays.
/// Two fits with the same fingerprint give the same bits. All processes that share the rays must
/// call it and get the same text.
std::string fingerprint_of(const options::ReconstructOptions& options,
                           const measurement::Measurement& series,
                           const distributed::Communicator& processes);

/// Names the differences between two fingerprints, as in "--seed, the tilt series or how it is
/// read".
std::string different_options(const std::string& found, const std::string& wanted);

/// Returns the trials as text without their times, so that a fit gives the same bytes whenever it
/// is made.
std::string trials_text(const tune::TunedFit& tuned);
/// Reads what trials_text() has written. Throws Error with what is wrong.
tune::TunedFit trials_from(const std::string& text);

}  // namespace tomofield::checkpoint
