#pragma once

#include "io/tables/mtf_table.h"

namespace tomofield::microscope {

/// The modulation transfer function (MTF) of a detector: the part of the signal that it passes.
struct Detector {
  io::MtfTable mtf;
  double pixel_size_A = 1.0;  ///< of a pixel of the detector, on the specimen

  /// Returns the transfer at a frequency in cycles per Å, by linear interpolation. Beyond the first
  /// and the last frequency it stays what it is there.
  double transfer(double k) const;
};

}  // namespace tomofield::microscope
