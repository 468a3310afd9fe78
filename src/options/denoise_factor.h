#pragma once

#include <string>

#include "tomofield/options.h"

namespace tomofield::options {

/// A strength of `--denoise` that has a name.
struct DenoisePlace {
  const char* name;
  double factor;
};
inline constexpr DenoisePlace kDenoisePlaces[] = {{"light", 0.5}, {"medium", 1.0}, {"strong", 2.0}};

/// Returns the factor by which `--denoise` multiplies the weight of total variation: light is 0.5,
/// medium is 1 and strong is 2; a number is itself. Throws Error for any other text, and for
/// numbers that are not from 0.05 to 20.
double denoise_factor(const std::string& text);

/// Returns the options of a fit with its weight of total variation multiplied by that factor. The
/// options of a run keep the weight that was given or chosen, so that they make the same fit when
/// they are given again.
FitOptions with_denoise(FitOptions fit);

}  // namespace tomofield::options
