#include "base/interruption.h"

#include <utility>

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

}  // namespace tomofield::base
