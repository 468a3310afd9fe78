#include <cstdlib>

#include "base/check.h"
#include "distributed/communicator.h"

// The Communicator of a build without MPI (TOMOFIELD_WITH_MPI=OFF), which is always alone.
namespace tomofield::distributed {

template <typename T>
void Communicator::allreduce_sum(std::span<T>) const {}
template void Communicator::allreduce_sum(std::span<float>) const;
template void Communicator::allreduce_sum(std::span<double>) const;
template void Communicator::allreduce_sum(std::span<std::int64_t>) const;

double Communicator::allreduce_max(double value) const { return value; }
void Communicator::broadcast(std::span<std::byte>, int) const {}
void Communicator::exchange(const Halo&) const {}

template <typename T>
void Communicator::send(std::span<const T>, int) const {
  TOMOFIELD_CHECK(size_ > 1, "there is another process to send to");
}
template void Communicator::send(std::span<const float>, int) const;
template void Communicator::send(std::span<const std::int64_t>, int) const;

struct Communicator::Sending::State {};
Communicator::Sending::Sending(std::unique_ptr<State>) {}
Communicator::Sending::Sending(Sending&&) noexcept = default;
Communicator::Sending::~Sending() = default;

Communicator::Sending Communicator::start_sending(std::vector<float> values, int) const {
  TOMOFIELD_CHECK(values.empty(), "there is another process to send to");
  return Sending(nullptr);
}

template <typename T>
void Communicator::receive(std::span<T>, int) const {
  TOMOFIELD_CHECK(size_ > 1, "there is another process to receive from");
}
template void Communicator::receive(std::span<float>, int) const;
template void Communicator::receive(std::span<std::int64_t>, int) const;

Session::Session() {
  if (!is_part_of_a_job([](const char* name) -> const char* { return std::getenv(name); })) return;
  throw Error(
      "this process was started as one of several, but this tomofield was built without MPI: each "
      "would do all the work and write the same files. Start it without mpirun or srun, or build "
      "it with -DTOMOFIELD_WITH_MPI=ON");
}

Session::~Session() = default;
void Session::abort(int) const {}

}  // namespace tomofield::distributed
