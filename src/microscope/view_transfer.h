#pragma once

#include <memory>

#include "io/tables/view_table.h"
#include "microscope/ctf.h"
#include "microscope/defocus_slope.h"
#include "microscope/detector.h"

namespace tomofield::microscope {

/// Describes what turns a projection of density, in which dense is high, into a view.
struct ViewTransfer {
  Optics optics;
  io::Defocus defocus;        ///< with its angle in the image that is filtered
  DefocusSlope slope;         ///< over that image
  double exposure = 0.0;      ///< electrons per Å² (Exposure::at_middle()); 0: no damage
  double pixel_size_A = 1.0;  ///< of that image
  bool is_flipped = false;    ///< the view's phases were flipped: |CTF| instead of −CTF
  std::shared_ptr<const Detector> detector = {};  ///< none: it passes all of the signal

  /// Returns the transfer of the image whose pixels are means over `bin`² of these.
  ViewTransfer binned(int bin) const {
    ViewTransfer coarse = *this;
    coarse.pixel_size_A *= bin;
    coarse.slope.x_A *= bin;
    coarse.slope.y_A *= bin;
    return coarse;
  }
};

}  // namespace tomofield::microscope
