#pragma once

#include <span>

#include "distributed/communicator.h"
#include "measurement/measurement.h"

/// Decides about beads that a bright series turned out to have (Measurement::undecided_beads).
/// Bright particles may be markers, which spoil a fit, or the specimen itself.
namespace tomofield::measurement {

/// Masks the rays of undecided beads in all views, in place: nothing is undecided then. Does
/// nothing if nothing is undecided. No copy of the measurement may share its rays. Every process
/// that holds a share of the rays calls it.
void hide_beads(Measurement& measurement,
                const distributed::Communicator& processes = distributed::Communicator::alone());

/// Lets the rays of undecided beads count as all others do: nothing is undecided then.
void keep_beads(Measurement& measurement);

/// Returns a copy, with rays of its own, in which the undecided beads are masked in `views` alone
/// and count in the others; nothing is undecided in it. `measurement` must have all of its rays in
/// this process, as that of a trial has (middle_rows()).
///
/// A trial compares a fit with masks to one without them. Both must predict the same rays, so beads
/// are hidden in the held-out views of both: give all views for the one and the held-out views for
/// the other.
Measurement with_beads_hidden(const Measurement& measurement, std::span<const int> views);

}  // namespace tomofield::measurement
