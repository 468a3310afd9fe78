#pragma once

#include <vector>

#include "tilt_series/image.h"
#include "tilt_series/masks/fill_frame.h"

namespace tomofield::tilt_series {

/// Finds fill of random values, each drawn for itself: from the image near by, as AreTomo does
/// (mGRandom in its Correct/GCorrPatchShift.cu), or around a mean. Such fill has no structure:
/// neighbouring pixels are not correlated, while those of an image are.
///
/// Images of more than 512 pixels a side are binned first. A pixel's product with the mean of the
/// 24 pixels around it, less a local mean, counts against fill, and half of the product that three
/// quarters of the image's middle exceed counts for it. The rectangle with the largest sum
/// beyond its sides is taken (fill_frame.h). The result stands only if all of this is so:
/// - The fill has no more correlation than chance and a fifth of that of the image.
/// - The image just within a side is correlated along three quarters of its length.
/// - Image and fill have nearly the same mean and pixels of nearly the same variance there.
/// - The sides are together nearly as long as the image's shorter one.
///
/// Images whose weakest quarter has no correlation have empty space of their own, or too much
/// noise to tell. Nothing is found there, and nothing in images below 64 pixels a side.
std::vector<FillSide> find_noise_fill(const MaskedImage& image);

}  // namespace tomofield::tilt_series
