#pragma once

#include <vector>

#include "tilt_series/image.h"
#include "tilt_series/masks/fill_frame.h"

namespace tomofield::tilt_series {

/// Finds fill of random values, each drawn for itself: from the image near by, as AreTomo2 does
/// (Correct/GCorrPatchShift.cu), or around a mean. Neighbouring pixels of such fill are not
/// correlated, while those of an image are (correlation.h).
///
/// Images of more than 1536 pixels a side are binned first, and everything is averaged over cells,
/// at most 512 a side. A cell's product counts against fill, and 0.7 of the product that three
/// quarters of the image's middle exceed counts for it. (AreTomo2 takes pixels from 51 × 51 pixels,
/// so its fill has the image's structure where that is coarser. More binning would leave nothing
/// else.) The rectangle with the largest sum beyond its sides is taken (fill_frame.h). A side
/// stands only if all of this is so:
/// - The image just within is correlated along five of eight parts of the side, and at most one of
///   them has no correlation at all.
/// - The fill just beyond has at most half of the image's correlation. Fill from near by has some,
///   since it follows the brightness of the image.
/// - The means of both differ by at most half a standard deviation of the image, and the variances
///   of their pixels at most by factors of 2 and 4.
///
/// The sides that stand must together be nearly as long as the image's shorter one. Then the others
/// are taken as well if their fill is clearly not correlated. Images whose
/// weakest quarter has no correlation have empty space of their own, or too much noise to tell.
/// Nothing is found there, and nothing in images below 128 pixels a side.
std::vector<FillSide> find_noise_fill(const MaskedImage& image);

}  // namespace tomofield::tilt_series
