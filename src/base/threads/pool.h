#pragma once

#include <algorithm>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "base/threads/parallel.h"

namespace tomofield::base {

/// Lends objects to tasks that need scratch memory, so that it is kept from one task to the next.
/// There are as many as were ever lent at once. A thread gets the object back that it used last, if
/// that is there, since its memory lies near the thread. Thread-safe.
template <typename T>
class Pool {
  struct Returner {
    Pool* pool;
    void operator()(T* object) const { pool->take_back(std::unique_ptr<T>(object)); }
  };

 public:
  /// Goes back to the pool when it is destroyed. The pool must outlive it.
  using Borrowed = std::unique_ptr<T, Returner>;

  /// Returns an object as its last user left it, or a new one.
  Borrowed borrow() {
    const std::lock_guard lock(mutex_);
    if (idle_.empty()) return Borrowed(std::make_unique<T>().release(), Returner{this});
    const auto mine = std::ranges::find(idle_, thread_index(), &Idle::thread);
    const auto chosen = mine != idle_.end() ? mine : idle_.end() - 1;
    Borrowed borrowed(chosen->object.release(), Returner{this});
    idle_.erase(chosen);
    return borrowed;
  }

 private:
  struct Idle {
    std::unique_ptr<T> object;
    int thread;
  };
  void take_back(std::unique_ptr<T> object) {
    const std::lock_guard lock(mutex_);
    idle_.push_back({std::move(object), thread_index()});
  }

  std::mutex mutex_;
  std::vector<Idle> idle_;
};

}  // namespace tomofield::base
