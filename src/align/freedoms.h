#pragma once

namespace tomofield::align {

/// Names what a registration may change beside the shift.
struct Freedoms {
  bool rotation = false;
  bool magnification = false;
  bool tilt = false;

  bool operator==(const Freedoms&) const = default;
};

}  // namespace tomofield::align
