#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <type_traits>

#include "base/progress.h"
#include "tomofield/error.h"
#include "view/http/connection.h"

namespace tomofield::view {

/// Says whether nobody waits for an answer any more.
using StopCheck = std::function<bool()>;
/// Computes an answer that takes time, on a thread of its own. Throws Error if the request asks for
/// what cannot be, and anything after `must_stop` has returned true, which it asks several times a
/// second.
using Work = std::function<Response(const StopCheck& must_stop)>;

/// Returns an answer that says why there is no other.
Response refusal(int status, const std::string& reason);

/// Returns the answer that `compute` returns, or one that has the reason why there is none: status
/// 400 for an Error, 500 for other exceptions.
template <typename Compute>
std::invoke_result_t<Compute> answer_or_refusal(const Compute& compute) {
  try {
    return compute();
  } catch (const Error& error) {
    return refusal(400, error.what());
  } catch (const base::StopRequested&) {
    return refusal(503, "nobody waits for the answer");
  } catch (const std::exception& error) {
    return refusal(500, error.what());
  }
}

/// A thread that does one piece of work after another.
class Worker {
 public:
  Worker();
  /// Stops what is being done and waits for that.
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /// Begins some work. Precondition: the answer of earlier work has been taken.
  void start(Work work);
  /// Asks the work to stop. Its answer is worth nothing, but is still to be taken.
  void stop() { must_stop_ = true; }
  /// Returns the answer of the work once it is done.
  std::optional<Response> take_answer();
  /// Returns a file descriptor that poll() finds readable when work has been done.
  int done_fd() const { return done_fd_; }

 private:
  void run();

  int done_fd_;
  std::atomic<bool> must_stop_ = false;
  std::mutex mutex_;
  std::condition_variable has_changed_;
  Work work_;                       // guarded by the mutex, as are the next two
  std::optional<Response> answer_;  // of the last work
  bool has_ended_ = false;
  std::thread thread_;  // the last member: it uses the others
};

}  // namespace tomofield::view
