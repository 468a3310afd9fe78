#include "api/public_call.h"

#include <chrono>
#include <mutex>

#include "base/progress.h"
#include "tomofield/error.h"

namespace tomofield::api {
namespace {

std::timed_mutex turn;
thread_local bool has_turn = false;

}  // namespace

void Listener::tell(const base::ProgressReport& report, bool is_trial) {
  if (!callback_ || wants_stop_) return;
  try {
    wants_stop_ = !callback_({.fraction_done = report.fraction_done,
                              .seconds_elapsed = report.seconds_elapsed,
                              .seconds_left = report.seconds_left,
                              .is_trial = is_trial,
                              .detail = report.detail});
  } catch (...) {
    raised_ = std::current_exception();
    wants_stop_ = true;
  }
}

void Listener::rethrow() const {
  if (raised_) std::rethrow_exception(raised_);
}

OneAtATime::OneAtATime() {
  if (has_turn)
    throw Error("a callback cannot start another reconstruction: start it when this one is done");
  constexpr std::chrono::milliseconds kPatience{100};
  while (!turn.try_lock_for(kPatience)) base::allow_interruption();
  has_turn = true;
}

OneAtATime::~OneAtATime() {
  has_turn = false;
  turn.unlock();
}

}  // namespace tomofield::api
