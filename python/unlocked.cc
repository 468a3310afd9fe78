#include "unlocked.h"

#include <tomofield/error.h>

#include <condition_variable>
#include <mutex>

namespace tomofield::python {
namespace {

namespace py = pybind11;

// All calls of this module that are in C++.
struct Calls {
  std::mutex mutex;
  std::condition_variable has_changed;
  int count = 0;         // guarded by the mutex, as is the next one
  bool is_over = false;  // the interpreter ends
};

// It is never destroyed: daemon threads live until the process ends.
Calls& calls() {
  static Calls* const all = new Calls;
  return *all;
}

void wait_for_calls() {
  const py::gil_scoped_release released;
  std::unique_lock lock(calls().mutex);
  calls().is_over = true;
  calls().has_changed.wait(lock, [] { return calls().count == 0; });
}

}  // namespace

Unlocked::Counted::Counted() {
  const std::lock_guard lock(calls().mutex);
  if (calls().is_over) throw Error("the Python interpreter ends: nothing can be begun any more");
  ++calls().count;
}

Unlocked::Counted::~Counted() {
  const std::lock_guard lock(calls().mutex);
  --calls().count;
  calls().has_changed.notify_all();
}

Unlocked::Unlocked() = default;

bool must_stop() {
  const std::lock_guard lock(calls().mutex);
  return calls().is_over;
}

void wait_at_exit() {
  py::module_::import("atexit").attr("register")(py::cpp_function(&wait_for_calls));
}

}  // namespace tomofield::python
