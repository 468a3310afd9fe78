#pragma once

#include <exception>
#include <memory>

#include "base/progress.h"
#include "base/threads/parallel.h"
#include "io/images/image_stack.h"
#include "tomofield/reconstruct.h"

// The public functions that work on a tilt series share these.
namespace tomofield {

struct TiltSeries::Impl {
  SeriesFiles files;
  std::shared_ptr<const io::ImageStack> images;  // none: the files
};

struct TiltSeriesAccess {
  static const TiltSeries::Impl& impl(const TiltSeries& series) { return *series.impl_; }
};

namespace api {

/// Calls the user's callback after every step. Remembers whether it wants to stop, and keeps an
/// exception of it until the work has ended in order.
class Listener {
 public:
  explicit Listener(const ProgressCallback& callback) : callback_(callback) {}

  bool has_callback() const { return static_cast<bool>(callback_); }
  void tell(const base::ProgressReport& report, bool is_trial);
  bool wants_stop() const { return wants_stop_; }
  /// Throws what the callback has thrown, if it has.
  void rethrow() const;

 private:
  const ProgressCallback& callback_;
  bool wants_stop_ = false;
  std::exception_ptr raised_;
};

/// Waits until no other thread works on a series, and lets others wait while it lives. Throws Error
/// in a callback, which would wait for itself.
class OneAtATime {
 public:
  OneAtATime();
  ~OneAtATime();
  OneAtATime(const OneAtATime&) = delete;
  OneAtATime& operator=(const OneAtATime&) = delete;

 private:
  base::ThreadsInUse threads_;
};

}  // namespace api
}  // namespace tomofield
