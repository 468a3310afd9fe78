#include "base/progress.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace tomofield::base {
namespace {

using Check = std::function<void()>;

Check& interruption() {
  static Check check;
  return check;
}

Check& loop_interruption() {
  static Check check;
  return check;
}

void call(const Check& check) {
  if (check) check();
}

}  // namespace

void set_interruption(std::function<void()> check) { interruption() = std::move(check); }
void allow_interruption() { call(interruption()); }

void set_loop_interruption(std::function<void()> check) { loop_interruption() = std::move(check); }
void allow_loop_interruption() { call(loop_interruption()); }

std::string time_text(double seconds) {
  const long s = std::lround(std::max(0.0, seconds));
  if (s >= 3600) return fmt::format("{} h {:02} min", s / 3600, s % 3600 / 60);
  if (s >= 60) return fmt::format("{} min {:02} s", s / 60, s % 60);
  return fmt::format("{} s", s);
}

}  // namespace tomofield::base
