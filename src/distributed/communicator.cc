#include "distributed/communicator.h"

#include <cstdlib>
#include <string_view>

// This file has what needs no MPI; communicator_mpi.cc, or communicator_alone.cc in a build without
// MPI, has the rest.
namespace tomofield::distributed {

const Communicator& Communicator::alone() {
  static const Communicator communicator;
  return communicator;
}

std::string Communicator::broadcast(std::string text, int owner) const {
  if (size_ == 1) return text;
  std::int64_t length = rank_ == owner ? std::ssize(text) : 0;
  allreduce_sum(std::span(&length, 1));
  text.resize(static_cast<std::size_t>(length));
  broadcast(std::as_writable_bytes(std::span(text)), owner);
  return text;
}

void Communicator::run_collectively(const std::function<void()>& body) const {
  if (size_ == 1) return body();
  std::string complaint;
  bool failed = false;
  try {
    body();
  } catch (const Error& error) {
    failed = true;
    complaint = error.what();
  }
  // The lowest rank that failed hands over the largest number.
  const double first = allreduce_max(failed ? size_ - rank_ : 0);
  if (first <= 0) return;
  throw SharedError(broadcast(complaint, size_ - static_cast<int>(first)));
}

bool is_part_of_a_job(const std::function<const char*(const char*)>& environment) {
  // OpenMPI's mpirun, PMI (MPICH, older srun) and srun give the number of processes in these.
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"}) {
    const char* const value = environment(name);
    if (value == nullptr) continue;
    // Without MPI support, srun starts several independent programs instead of one job.
    if (name == std::string_view("SLURM_STEP_NUM_TASKS") && environment("PMIX_RANK") == nullptr)
      continue;
    return std::atoi(value) > 1;
  }
  return false;
}

}  // namespace tomofield::distributed
