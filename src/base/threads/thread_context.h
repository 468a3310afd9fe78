#pragma once

#include <utility>

namespace tomofield::base {

/// Returns what belongs to the work of the calling thread: a pointer to something of its caller, or
/// null. In a parallel_for, the threads that help have that of the thread that called it.
inline void*& thread_context() {
  thread_local void* context = nullptr;
  return context;
}

/// Gives the calling thread another context while it lives.
class ContextScope {
 public:
  explicit ContextScope(void* context) : outer_(std::exchange(thread_context(), context)) {}
  ~ContextScope() { thread_context() = outer_; }
  ContextScope(const ContextScope&) = delete;
  ContextScope& operator=(const ContextScope&) = delete;

 private:
  void* outer_;
};

}  // namespace tomofield::base
