#include "unlocked.h"

#include <cxxabi.h>
#include <tomofield/error.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "base/progress.h"
#include "base/threads/fork_safe_mutex.h"
#include "base/threads/stoppable_loops.h"

namespace tomofield::python {
namespace {

namespace py = pybind11;

// All calls of this module that are in C++.
struct Calls {
  base::ForkSafeMutex mutex;
  std::condition_variable_any has_changed;
  int count = 0;                       // guarded by the mutex, as are the next ones
  int in_user_code = 0;                // of these calls
  bool is_over = false;                // the interpreter ends
  std::thread::id ending;              // the thread that ends it
  std::vector<unsigned long> stopped;  // identifiers of the threads that its end stops
  bool are_left = false;               // and waits for none of them any more
};

// It is never destroyed: daemon threads live until the process ends.
Calls& calls() {
  static Calls* const all = new Calls;
  return *all;
}

// A process that was forked has no other threads: what they began in its parent does not end in it.
pid_t g_own_process = 0;

// The calling thread is in work that may end anywhere. The threads that help it are not.
thread_local bool t_stops_anywhere = false;

thread_local std::exception_ptr t_raised;  // see keep_for_later()

// Ends the process by Ctrl-C: the interpreter cannot end in order while calls run.
void end_if_interrupted() {
  const py::gil_scoped_acquire locked;
  if (PyErr_CheckSignals() == 0) return;
  PyErr_Print();
  constexpr int kInterrupted = 130;
  _exit(kInterrupted);
}

// Keeps the calling thread where it is until the process ends.
[[noreturn]] void wait_for_the_end() {
  while (true) pause();
}

// Runs what asks for the interpreter's lock. Python ends a thread that asks after the interpreter's
// end, by unwinding it, and C++ cannot be unwound so: destructors would call Python.
template <typename Work>
auto stay_at_the_end(const Work& work) {
  try {
    return work();
  } catch (const abi::__forced_unwind&) {
    wait_for_the_end();
  }
}

// Waits for the threads that the end has stopped: what they do as they leave, such as printing,
// would hold locks that the interpreter needs. It does not wait long for what does not end.
void join_stopped_threads() {
  constexpr double kPatience_s = 1.0;
  std::vector<unsigned long> stopped;
  {
    const std::lock_guard lock(calls().mutex);
    stopped = calls().stopped;
  }
  for (const py::handle thread : py::module_::import("threading").attr("enumerate")()) {
    const py::object name = thread.attr("ident");
    if (!name.is_none() && std::ranges::count(stopped, name.cast<unsigned long>()) > 0)
      thread.attr("join")(kPatience_s);
  }
}

// Code of the user may wait for what the ending thread holds. It gets some seconds, and the
// interpreter then ends beside it.
void wait_for_calls() {
  constexpr std::chrono::milliseconds kStep{100}, kPatience{5000};
  const py::gil_scoped_release released;
  std::unique_lock lock(calls().mutex);
  calls().is_over = true;
  calls().ending = std::this_thread::get_id();
  std::chrono::milliseconds in_user_code{0};
  while (!calls().has_changed.wait_for(lock, kStep, [] { return calls().count == 0; })) {
    const bool are_all = calls().count == calls().in_user_code;
    in_user_code = are_all ? in_user_code + kStep : kStep * 0;
    calls().are_left = in_user_code >= kPatience;
    if (calls().are_left) return;
    lock.unlock();
    end_if_interrupted();
    lock.lock();
  }
}

void end_calls() {
  if (getpid() != g_own_process) return;
  wait_for_calls();
  join_stopped_threads();
}

}  // namespace

Unlocked::Counted::Counted() {
  const std::lock_guard lock(calls().mutex);
  if (calls().is_over) throw InterpreterEnds();
  ++calls().count;
}

Unlocked::Counted::~Counted() {
  const std::lock_guard lock(calls().mutex);
  --calls().count;
  calls().has_changed.notify_all();
}

InUserCode::Counted::Counted() {
  const std::lock_guard lock(calls().mutex);
  ++calls().in_user_code;
}

InUserCode::Counted::~Counted() {
  const std::lock_guard lock(calls().mutex);
  --calls().in_user_code;
}

InUserCode::InUserCode() {
  stay_at_the_end([&] { locked_.emplace(); });
}

py::object call(const py::object& function, const py::object& argument) {
  PyObject* const answer = stay_at_the_end(
      [&] { return PyObject_CallFunctionObjArgs(function.ptr(), argument.ptr(), nullptr); });
  if (answer == nullptr) throw py::error_already_set();
  return py::reinterpret_steal<py::object>(answer);
}

Unlocked::Unlocked(Stops stops) { t_stops_anywhere = stops == Stops::kAnywhere; }

Unlocked::~Unlocked() {
  t_stops_anywhere = false;
  const bool is_left = [] {
    const std::lock_guard lock(calls().mutex);
    if (calls().is_over) calls().stopped.push_back(PyThread_get_thread_ident());
    return calls().are_left;
  }();
  if (is_left) wait_for_the_end();  // it cannot have the lock any more
}

// Ends work that has no callback once the interpreter ends, or by what a handler of signals raises.
// Only one thread in a tenth of a second takes the interpreter's lock.
void interrupt() {
  using Clock = std::chrono::steady_clock;
  static std::atomic<Clock::rep> next{0};
  if (must_stop()) throw InterpreterEnds();
  const Clock::time_point now = Clock::now();
  Clock::rep due = next;
  if (now.time_since_epoch().count() < due ||
      !next.compare_exchange_strong(
          due, (now + std::chrono::milliseconds(100)).time_since_epoch().count()))
    return;
  const py::gil_scoped_acquire locked;
  check_signals();
}

void interrupt_loop() {
  if (t_stops_anywhere || base::StoppableLoops::are_there()) interrupt();
}

void keep_for_later(std::exception_ptr raised) { t_raised = std::move(raised); }

void check_signals() {
  if (std::exception_ptr raised = std::exchange(t_raised, nullptr)) std::rethrow_exception(raised);
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

bool must_stop() {
  const std::lock_guard lock(calls().mutex);
  return calls().is_over;
}

// Python prints nothing for a thread that SystemExit ends. What a daemon thread prints while the
// interpreter ends may hold the lock of stderr for ever, which aborts the process.
void InterpreterEnds::raise() {
  const bool is_ending_thread = [] {
    const std::lock_guard lock(calls().mutex);
    if (calls().ending == std::this_thread::get_id()) return true;
    calls().stopped.push_back(PyThread_get_thread_ident());
    return false;
  }();
  if (!is_ending_thread) return PyErr_SetNone(PyExc_SystemExit);
  const auto type = py::module_::import("tomofield._core").attr("Error");
  PyErr_SetString(type.ptr(), "the Python interpreter ends: nothing can be begun any more");
}

void wait_at_exit() {
  g_own_process = getpid();
  base::set_interruption(interrupt);
  base::set_loop_interruption(interrupt_loop);
  py::module_::import("atexit").attr("register")(py::cpp_function(&end_calls));
}

}  // namespace tomofield::python
