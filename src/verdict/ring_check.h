#pragma once

#include <optional>
#include <vector>

#include "evaluate/image_pair.h"
#include "microscope/view_transfer.h"

namespace tomofield::verdict {

/// The agreement of the rings in the power spectra of views (Thon rings) with the given defocus. No
/// field takes part in it, so that it sees errors that a field cannot be fitted with.
struct RingCheck {
  /// True defocus over the given one: that with which spectra and transfers agree best, from 0.6
  /// to 1.65.
  double factor = 1.0;
  /// Mean correlation of the logarithm of a view's spectrum with CTF² of that defocus. What a
  /// polynomial of the frequency explains of either does not count.
  double agreement = 0.0;
  double given = 0.0;  ///< the same with the given defocus
  /// Standard error of the difference of these two, by the scatter of the views.
  double standard_error = 0.0;
  /// Number of rings from the lowest frequency to Nyquist's: half periods of the given CTF in the
  /// mean view. Few rings cannot be told from how the specimen's spectrum falls.
  double rings = 0.0;
};

/// Checks views with their transfers, one a view. The defocus is that of the middle of each view.
/// Returns nothing for fewer than five views with a defocus, or for views below 32 pixels.
std::optional<RingCheck> check_rings(const std::vector<evaluate::Image>& views,
                                     const std::vector<microscope::ViewTransfer>& transfers);

}  // namespace tomofield::verdict
