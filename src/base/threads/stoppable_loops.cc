#include "base/threads/stoppable_loops.h"

#include <utility>

#include "base/check.h"
#include "base/progress.h"

namespace tomofield::base {
namespace {

thread_local const StoppableLoops* t_loops = nullptr;

}  // namespace

StoppableLoops::StoppableLoops(std::function<bool()> is_asked) : is_asked_(std::move(is_asked)) {
  TOMOFIELD_CHECK(t_loops == nullptr, "loops that stop are not nested");
  t_loops = this;
}

StoppableLoops::~StoppableLoops() { t_loops = nullptr; }

bool StoppableLoops::are_there() { return t_loops != nullptr; }

void StoppableLoops::check() {
  if (t_loops != nullptr && t_loops->is_asked_ && t_loops->is_asked_()) throw StopRequested{};
}

}  // namespace tomofield::base
