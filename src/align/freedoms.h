#pragma once

namespace tomofield::alignment {

/// The quantities of a view that a registration may change.
struct Freedoms {
  bool shift = true;
  bool rotation = false;
  bool magnification = false;
  bool tilt = false;

  bool operator==(const Freedoms&) const = default;
};

}  // namespace tomofield::alignment
