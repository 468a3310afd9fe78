#pragma once

#include <vector>

#include "tilt_series/image.h"

namespace tomofield::tilt_series {

/// A round spot that is denser than everything around it.
struct Spot {
  double x_px = 0.0;  ///< its centre; pixel i covers [i, i + 1)
  double y_px = 0.0;
  double contrast = 0.0;    ///< by how much it is denser than its surroundings
  double strength = 0.0;    ///< the same over the spread of all places of the image
  bool is_precise = false;  ///< its place is that of spot_place.h
};

/// Finds round spots of about this diameter (pixels, >= 2) in an image whose dense
/// parts are high. Returns those with strength >= `min_strength`, in rows from the
/// lowest, left to right.
///
/// The contrast of a place is the mean of a disc there less the mean of an
/// equal disc one and a quarter diameters away. The third lowest difference of 16 directions
/// counts, so that edges, ridges and lines have no contrast and a
/// spot with a close neighbour has one. Spread is the median absolute deviation of
/// the contrast; structure and noise determine it, and few spots do not change it.
/// Large spots are found in a reduced image. Discs need most of their
/// pixels to be measurements.
std::vector<Spot> find_spots(const MaskedImage& image, double diameter_px, double min_strength);

}  // namespace tomofield::tilt_series
