#pragma once

#include <vector>

#include "tilt_series/image.h"
#include "tilt_series/masks/fill_frame.h"
#include "tomofield/options.h"

namespace tomofield::tilt_series {

/// Finds fill that is flat but not constant, as dither, lossy compression or
/// filtering after the alignment leave it. There are up to four wedges along the sides
/// of one rotated, shifted rectangle (rotation at most 15° either way), each
/// of which holds a corner of the image.
///
/// Box means are compared with the values in the flat corners. Every strip
/// parallel to a side of the rectangle counts for fill by the samples that
/// are alike and, ten times as much, against it by those that are not. The rotation
/// and the four offsets with the largest count are taken. The result stands only if its
/// sides are together nearly as long as the image's shorter one (those of a
/// rotated image are, whatever its shift), most pixels just within them are
/// unlike the fill, and the fill is smoother than the rest of the image.
///
/// The darkest places of a bright image are space without specimen and never
/// fill. An image with a whole edge of one value has constant fill or no noise
/// and is left to constant_fill.h. The result is empty if there is no fill. Offsets are of
/// the flat part; a mask must add their blur. Images below 64 pixels a
/// side have none.
std::vector<FillSide> find_straight_fill(Contrast contrast, const MaskedImage& image);

}  // namespace tomofield::tilt_series
