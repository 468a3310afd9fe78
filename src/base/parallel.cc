#include "base/parallel.h"

#include <omp.h>

#include <algorithm>

namespace tomofield::base {
namespace {
int g_thread_count = 0;
}

int thread_count() { return g_thread_count > 0 ? g_thread_count : omp_get_max_threads(); }
void set_thread_count(int count) { g_thread_count = std::max(count, 0); }
int thread_index() { return omp_get_thread_num(); }

}  // namespace tomofield::base
