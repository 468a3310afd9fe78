#include "base/progress.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace tomofield::base {
namespace {

std::function<void()>& interruption() {
  static std::function<void()> check;
  return check;
}

}  // namespace

void set_interruption(std::function<void()> check) { interruption() = std::move(check); }

void allow_interruption() {
  if (interruption()) interruption()();
}

std::string time_text(double seconds) {
  const long s = std::lround(std::max(0.0, seconds));
  if (s >= 3600) return fmt::format("{} h {:02} min", s / 3600, s % 3600 / 60);
  if (s >= 60) return fmt::format("{} min {:02} s", s / 60, s % 60);
  return fmt::format("{} s", s);
}

}  // namespace tomofield::base
