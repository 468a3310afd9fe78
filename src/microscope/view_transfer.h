#pragma once

#include <memory>

#include "geometry/raw_from_aligned.h"
#include "io/tables/mtf_table.h"
#include "io/tables/view_table.h"
#include "microscope/ctf.h"

namespace tomofield::microscope {

/// Describes how the underfocus changes over an image: what is added to that of the view at a pixel
/// (x, y), relative to the image's centre, is at_centre_A + x_A x + y_A y.
struct DefocusSlope {
  double at_centre_A = 0.0;
  double x_A = 0.0, y_A = 0.0;  ///< per pixel

  double at(double x_px, double y_px) const { return at_centre_A + x_A * x_px + y_A * y_px; }
};

/// The side of a tilted view that is farther from focus. The geometry of tomofield says that it is
/// the right side at a positive tilt, as IMOD has it; data of the other hand have the left one.
enum class DefocusHand { kRight = 1, kLeft = -1 };

/// Returns the slope of a view that shows the plane Z = 0 of the specimen. The defocus of the view
/// is that on the tilt axis, x = 0 of the aligned view. Z points to the source, and a point of the
/// specimen at height −X sin θ + Z cos θ is nearer to focus by its height: so underfocus grows by
/// x tan θ. The image is the aligned one, or that of which `map` is the place of aligned pixels.
DefocusSlope slope_of_tilt(double tilt_deg, double pixel_size_A, DefocusHand hand,
                           const geometry::RawFromAligned& map = {});

/// The modulation transfer function (MTF) of a detector: the part of the signal that it passes.
struct Detector {
  io::MtfTable mtf;
  double pixel_size_A = 1.0;  ///< of a pixel of the detector, on the specimen

  /// Returns the transfer at a frequency in cycles per Å, by linear interpolation. Beyond the first
  /// and the last frequency it stays what it is there.
  double transfer(double k) const;
};

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

/// Returns over how many pixels the defocus and the spherical aberration spread detail of an image:
/// the largest |λ Δz k − Cs λ³ k³| of frequencies k up to 1 / (2 p), over the pixel size p. Where
/// these are more than the image has, the rings of the transfer are too narrow to be told
/// apart, and no correction means anything (Crowther et al. 1996).
double spread_px(const ViewTransfer& transfer);

}  // namespace tomofield::microscope
