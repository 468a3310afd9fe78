#include "distributed/communicator.h"

#define OMPI_SKIP_MPICXX 1
#define MPICH_SKIP_MPICXX 1
#include <mpi.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "base/check.h"
#include "base/progress.h"

namespace tomofield::distributed {
namespace {

const MPI_Comm kAll = MPI_COMM_WORLD;
constexpr int kTag = 1;
// MPI counts in ints, so longer arrays go in pieces of this many elements.
constexpr std::size_t kMaxAtOnce = std::size_t{1} << 28;

template <typename T>
MPI_Datatype type_of();
template <>
MPI_Datatype type_of<float>() {
  return MPI_FLOAT;
}
template <>
MPI_Datatype type_of<double>() {
  return MPI_DOUBLE;
}
template <>
MPI_Datatype type_of<std::int64_t>() {
  return MPI_INT64_T;
}

// Adds the time for which it lives to the seconds spent on waiting for others.
class Waiting {
 public:
  explicit Waiting(double& seconds) : seconds_(seconds) {}
  ~Waiting() { seconds_ += since_.seconds(); }

 private:
  double& seconds_;
  base::Stopwatch since_;
};

// Calls body(piece) for pieces whose elements MPI can count.
template <typename T, typename Body>
void for_each_piece(std::span<T> values, const Body& body) {
  for (std::size_t at = 0; at < values.size(); at += kMaxAtOnce)
    body(values.subspan(at, std::min(kMaxAtOnce, values.size() - at)));
}

}  // namespace

struct Communicator::Requests {
  std::vector<MPI_Request> all;
  MPI_Request* next() { return &all.emplace_back(MPI_REQUEST_NULL); }
};

// Waits until all requests are complete. It yields the core, which other ranks may need, and sleeps
// between tests if the wait is long.
void Communicator::finish(Requests& requests) const {
  constexpr int kTestsBeforeSleep = 2000;
  for (int done = 0, tests = 0;; ++tests) {
    MPI_Testall(static_cast<int>(requests.all.size()), requests.all.data(), &done,
                MPI_STATUSES_IGNORE);
    if (done) return;
    if (tests < kTestsBeforeSleep) {
      std::this_thread::yield();
    } else {
      check_();
      std::this_thread::sleep_for(std::chrono::microseconds(50));
    }
  }
}

template <typename T>
void Communicator::allreduce_sum(std::span<T> values) const {
  if (size_ == 1) return;
  const Waiting waiting(traffic_.seconds);
  for_each_piece(values, [this](std::span<T> piece) {
    Requests request;
    MPI_Iallreduce(MPI_IN_PLACE, piece.data(), static_cast<int>(piece.size()), type_of<T>(),
                   MPI_SUM, kAll, request.next());
    finish(request);
  });
  traffic_.bytes += static_cast<std::int64_t>(values.size_bytes());
}
template void Communicator::allreduce_sum(std::span<float>) const;
template void Communicator::allreduce_sum(std::span<double>) const;
template void Communicator::allreduce_sum(std::span<std::int64_t>) const;

double Communicator::allreduce_max(double value) const {
  if (size_ == 1) return value;
  const Waiting waiting(traffic_.seconds);
  Requests request;
  MPI_Iallreduce(MPI_IN_PLACE, &value, 1, MPI_DOUBLE, MPI_MAX, kAll, request.next());
  finish(request);
  traffic_.bytes += static_cast<std::int64_t>(sizeof value);
  return value;
}

void Communicator::broadcast(std::span<std::byte> bytes, int owner) const {
  if (size_ == 1) return;
  const Waiting waiting(traffic_.seconds);
  for_each_piece(bytes, [&](std::span<std::byte> piece) {
    Requests request;
    MPI_Ibcast(piece.data(), static_cast<int>(piece.size()), MPI_BYTE, owner, kAll, request.next());
    finish(request);
  });
}

void Communicator::exchange(const Halo& halo) const {
  if (size_ == 1) return;
  const Waiting waiting(traffic_.seconds);
  Requests requests;
  const auto take = [&](std::span<float> values, int from) {
    for_each_piece(values, [&](std::span<float> piece) {
      MPI_Irecv(piece.data(), static_cast<int>(piece.size()), MPI_FLOAT, from, kTag, kAll,
                requests.next());
    });
  };
  const auto hand = [&](std::span<const float> values, int to) {
    for_each_piece(values, [&](std::span<const float> piece) {
      MPI_Isend(piece.data(), static_cast<int>(piece.size()), MPI_FLOAT, to, kTag, kAll,
                requests.next());
    });
    traffic_.bytes += static_cast<std::int64_t>(values.size_bytes());
  };
  take(halo.from_before, rank_ - 1);
  take(halo.from_after, rank_ + 1);
  hand(halo.to_before, rank_ - 1);
  hand(halo.to_after, rank_ + 1);
  finish(requests);
}

template <typename T>
void Communicator::send(std::span<const T> values, int to) const {
  const Waiting waiting(traffic_.seconds);
  for_each_piece(values, [&](std::span<const T> piece) {
    Requests request;
    MPI_Isend(piece.data(), static_cast<int>(piece.size()), type_of<T>(), to, kTag, kAll,
              request.next());
    finish(request);
  });
  traffic_.bytes += static_cast<std::int64_t>(values.size_bytes());
}
template void Communicator::send(std::span<const float>, int) const;
template void Communicator::send(std::span<const std::int64_t>, int) const;

struct Communicator::Sending::State {
  const Communicator& processes;
  std::vector<float> values;
  Requests requests;
};

Communicator::Sending::Sending(std::unique_ptr<State> state) : state_(std::move(state)) {}
Communicator::Sending::Sending(Sending&&) noexcept = default;
Communicator::Sending::~Sending() {
  if (!state_ || state_->requests.all.empty()) return;
  const Waiting waiting(state_->processes.traffic_.seconds);
  state_->processes.finish(state_->requests);
}

Communicator::Sending Communicator::start_sending(std::vector<float> values, int to) const {
  // Trials on several threads share the communicator of one rank, so that it stays as it is.
  if (values.empty()) return Sending(nullptr);
  std::unique_ptr<Sending::State> state(new Sending::State{*this, std::move(values), {}});
  traffic_.bytes += static_cast<std::int64_t>(state->values.size() * sizeof(float));
  for_each_piece(std::span(state->values), [&](std::span<float> piece) {
    MPI_Isend(piece.data(), static_cast<int>(piece.size()), MPI_FLOAT, to, kTag, kAll,
              state->requests.next());
  });
  return Sending(std::move(state));
}

template <typename T>
void Communicator::receive(std::span<T> values, int from) const {
  const Waiting waiting(traffic_.seconds);
  for_each_piece(values, [&](std::span<T> piece) {
    Requests request;
    MPI_Irecv(piece.data(), static_cast<int>(piece.size()), type_of<T>(), from, kTag, kAll,
              request.next());
    finish(request);
  });
}
template void Communicator::receive(std::span<float>, int) const;
template void Communicator::receive(std::span<std::int64_t>, int) const;

Session::Session() {
  if (!is_part_of_a_job([](const char* name) -> const char* { return std::getenv(name); })) return;
  int provided = 0;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &provided);
  TOMOFIELD_CHECK(provided >= MPI_THREAD_FUNNELED, "this MPI does not allow for threads");
  MPI_Comm_rank(kAll, &communicator_.rank_);
  MPI_Comm_size(kAll, &communicator_.size_);
  if (communicator_.size_ == 1) {
    MPI_Finalize();
    throw Error(
        "this process was started as one of several, but MPI sees it alone: each would do all the "
        "work and write the same files. Start it with the mpirun of the MPI that tomofield was "
        "built with, or with the srun --mpi option that this MPI speaks (srun --mpi=list)");
  }
  MPI_Comm machine = MPI_COMM_NULL;
  MPI_Comm_split_type(kAll, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &machine);
  MPI_Comm_size(machine, &communicator_.size_on_machine_);
  MPI_Comm_free(&machine);
}

Session::~Session() {
  if (communicator_.size_ > 1) MPI_Finalize();
}

void Session::abort(int status) const {
  if (communicator_.size_ > 1) MPI_Abort(kAll, status);
}

}  // namespace tomofield::distributed
