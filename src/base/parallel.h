#pragma once

#include <cstdint>
#include <exception>
#include <utility>

namespace tomofield::base {

/// Returns the number of threads that parallel_for uses. It is set once, at start-up.
int thread_count();
void set_thread_count(int count);

/// Returns the index of the calling thread inside a parallel_for, 0 <= index < thread_count().
int thread_index();

/// Calls body(i) for i in [0, count), in any order, on thread_count() threads. If bodies throw,
/// rethrows the first exception after all threads have stopped. Results must not depend on which
/// thread runs an index.
template <typename Body>
void parallel_for(std::int64_t count, Body&& body) {
  std::exception_ptr failure;
#pragma omp parallel for schedule(dynamic, 1) num_threads(thread_count())
  for (std::int64_t i = 0; i < count; ++i) {
    try {
      body(i);
    } catch (...) {
#pragma omp critical(tomofield_parallel_failure)
      if (!failure) failure = std::current_exception();
    }
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace tomofield::base
