#include "options/denoise_factor.h"

#include <fmt/format.h>

#include <cstdlib>

#include "tomofield/error.h"

namespace tomofield::options {
namespace {

constexpr double kLeastFactor = 0.05, kMostFactor = 20;

}  // namespace

double denoise_factor(const std::string& text) {
  for (const DenoisePlace& place : kDenoisePlaces)
    if (text == place.name) return place.factor;
  char* end = nullptr;
  const double factor = std::strtod(text.c_str(), &end);
  if (end == text.c_str() || *end != '\0' || !(factor >= kLeastFactor && factor <= kMostFactor))
    throw Error(fmt::format(
        "--denoise '{}' is no strength: give light, medium, strong, or a factor from {} to {}",
        text, kLeastFactor, kMostFactor));
  return factor;
}

FitOptions with_denoise(FitOptions fit) {
  fit.density_variation = fit.density_variation * denoise_factor(fit.denoise);
  return fit;
}

}  // namespace tomofield::options
