#pragma once

#include <string>

namespace tomofield::compact {

/// The limit of a compact model's size, or of its change.
struct Budget {
  enum class Kind { kDecibels, kParameters, kBytes };
  Kind kind = Kind::kDecibels;
  double amount = 0.1;
};

/// The largest change of a model, as the decibels that its PSNR falls by.
inline constexpr double kMostDecibels = 10;

/// Parses a budget: "0.1dB", a number of parameters such as "500000" or "2M", or a size such as
/// "5MB" or "800kB" (k and M are powers of 1000). Throws Error with the valid forms for anything
/// else, and for amounts out of range.
Budget parse_budget(const std::string& text);

}  // namespace tomofield::compact
