#pragma once

#include <pybind11/pybind11.h>

#include <exception>
#include <optional>

namespace tomofield::python {

/// The interpreter ends, and with it what runs in C++.
class InterpreterEnds {
 public:
  /// Raises tomofield.Error in the thread that ends the interpreter, and SystemExit in all others.
  static void raise();
};

/// Gives up the interpreter's lock while C++ works, and takes it back at the end.
///
/// A daemon thread may be in C++ when the interpreter ends. Python would end that thread at its
/// next wish for the lock, through C++ that cannot be unwound, and the process would abort. So the
/// interpreter waits for all objects of this class before it ends (wait_at_exit()), reconstructions
/// stop at their next step (must_stop()), other work at its next part, and none can be made
/// afterwards: the constructor throws InterpreterEnds.
class Unlocked {
 public:
  /// Where Ctrl-C and the end of the interpreter stop the work.
  enum class Stops { kAnywhere, kByCallback };
  explicit Unlocked(Stops stops = Stops::kAnywhere);
  ~Unlocked();
  Unlocked(const Unlocked&) = delete;
  Unlocked& operator=(const Unlocked&) = delete;

 private:
  struct Counted {
    Counted();
    ~Counted();
  };
  Counted counted_;  // the first member: it counts until the lock is taken back
  pybind11::gil_scoped_release released_;
};

/// Takes the interpreter's lock in a thread that has given it up, to run code of the user, who may
/// wait or compute for any time. The interpreter's end does not wait for that: the thread then
/// stays where it is until the process ends.
class InUserCode {
 public:
  InUserCode();
  InUserCode(const InUserCode&) = delete;
  InUserCode& operator=(const InUserCode&) = delete;

 private:
  struct Counted {
    Counted();
    ~Counted();
  };
  Counted counted_;  // the first member: it ends after the lock was given back
  std::optional<pybind11::gil_scoped_acquire> locked_;
};

/// Calls a function of the user, within InUserCode. Throws what it raises.
pybind11::object call(const pybind11::object& function, const pybind11::object& argument);

/// Returns true once the interpreter ends.
bool must_stop();

/// Keeps what a handler of signals has raised where it could not be thrown, for check_signals() of
/// this thread.
void keep_for_later(std::exception_ptr raised);
/// Throws what handlers of signals raise, or have raised. The caller has the interpreter's lock.
void check_signals();

/// Lets the interpreter wait at its end for what runs in C++, and Ctrl-C stop what has no callback.
/// It waits for no longer than some seconds for code of the user, and Ctrl-C ends the process.
void wait_at_exit();

}  // namespace tomofield::python
