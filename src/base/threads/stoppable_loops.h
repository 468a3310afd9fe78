#pragma once

#include <functional>

namespace tomofield::base {

/// While it lives, the loops that its thread starts (parallel_for) end by StopRequested once a stop
/// is asked for: for work in the middle of which nothing has to be kept. Only one lives in a
/// thread.
class StoppableLoops {
 public:
  /// `is_asked` is called often, and by this thread alone; empty: nobody asks.
  explicit StoppableLoops(std::function<bool()> is_asked);
  ~StoppableLoops();
  StoppableLoops(const StoppableLoops&) = delete;
  StoppableLoops& operator=(const StoppableLoops&) = delete;

  /// Tells whether one lives in this thread.
  static bool are_there();
  /// Throws StopRequested if one lives in this thread and a stop is asked for.
  static void check();

 private:
  std::function<bool()> is_asked_;
};

}  // namespace tomofield::base
