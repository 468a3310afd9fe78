#pragma once

#include <fftw3.h>

#include <mutex>

#include "base/check.h"
#include "base/threads/fork_safe_mutex.h"

namespace tomofield::fourier {

/// A plan of FFTW, which makes and frees one plan at a time. `make` returns the plan. A plan that
/// FFTW did not measure is the same in every run, so the results have the same bits: give
/// FFTW_ESTIMATE.
class FftwPlan {
 public:
  template <typename Make>
  explicit FftwPlan(const Make& make) {
    const std::lock_guard lock(one_at_a_time());
    plan_ = make();
    TOMOFIELD_CHECK(plan_ != nullptr, "plan of the transform");
  }
  FftwPlan(const FftwPlan&) = delete;
  FftwPlan& operator=(const FftwPlan&) = delete;
  ~FftwPlan() {
    const std::lock_guard lock(one_at_a_time());
    fftwf_destroy_plan(plan_);
  }

  fftwf_plan get() const { return plan_; }

 private:
  static base::ForkSafeMutex& one_at_a_time() {
    static base::ForkSafeMutex mutex;
    return mutex;
  }

  fftwf_plan plan_;
};

}  // namespace tomofield::fourier
