#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tomofield/error.h"

namespace tomofield::distributed {

/// An Error that every process of a job throws alike (Communicator::run_collectively), so that the
/// job can end in order: one of them has to say it.
class SharedError : public Error {
 public:
  using Error::Error;
};

/// The processes of a job, one of which is this one: itself alone, or all that mpirun or
/// srun started (Session). Every process makes the same calls in the same order; those of a
/// process that is alone do nothing. For one thread of a process, the one that started it.
///
/// Nothing here depends on the order in which messages arrive: arrays are combined where each
/// element has one owner, so results have the same bits for any number of processes.
class Communicator {
 public:
  /// Of a process that works by itself.
  static const Communicator& alone();

  int rank() const { return rank_; }  ///< 0 <= rank < size
  int size() const { return size_; }
  /// Rank 0, which talks and writes what is not shared.
  bool is_first() const { return rank_ == 0; }
  /// Processes of the job that share this one's machine, itself included.
  int size_on_machine() const { return size_on_machine_; }

  /// Completes an array of which every element is 0 but in the process that owns it: the sum
  /// over all of them, element by element. T is float, double or std::int64_t.
  template <typename T>
  void allreduce_sum(std::span<T> values) const;
  /// The same for structs: `members` name every member that is to be summed, all of type T.
  template <typename Struct, typename T, typename... More>
  void allreduce_sum(std::span<Struct> structs, T Struct::*member, More Struct::*... more) const {
    if (size_ == 1) return;
    std::vector<T> values;
    for (Struct& s : structs) {
      values.push_back(s.*member);
      (values.push_back(s.*more), ...);
    }
    allreduce_sum(std::span(values));
    auto next = values.begin();
    for (Struct& s : structs) {
      s.*member = *next++;
      ((s.*more = *next++), ...);
    }
  }
  /// Returns the largest of what the processes hand over.
  double allreduce_max(double value) const;
  /// What `owner` has, to all.
  void broadcast(std::span<std::byte> bytes, int owner) const;
  std::string broadcast(std::string text, int owner = 0) const;

  /// Hands an array to the process before this one (in order of ranks) and takes one from it,
  /// and the same with the process after it. What has no neighbour is empty.
  struct Halo {
    std::span<const float> to_before, to_after;
    std::span<float> from_before, from_after;
  };
  void exchange(const Halo& halo) const;

  /// From one process to another, which waits for it. T is float or std::int64_t.
  template <typename T>
  void send(std::span<const T> values, int to) const;
  template <typename T>
  void receive(std::span<T> values, int from) const;

  /// Runs `body`, which does not communicate, on every process. If it throws Error on one, all
  /// throw SharedError with the message of the first of those.
  void run_collectively(const std::function<void()>& body) const;

  /// `check` is called now and then while this process waits for others for long.
  void while_waiting(std::function<void()> check) const { check_ = std::move(check); }

  /// What this process has sent and how long it has waited for others, since it began.
  struct Traffic {
    double seconds = 0.0;
    std::int64_t bytes = 0;
  };
  const Traffic& traffic() const { return traffic_; }

 private:
  friend class Session;
  Communicator() = default;
  struct Requests;
  void finish(Requests& requests) const;

  int rank_ = 0, size_ = 1, size_on_machine_ = 1;
  mutable Traffic traffic_;
  mutable std::function<void()> check_ = [] {};
};

/// Whether mpirun or srun started this process as one of several, told from the environment.
bool is_part_of_a_job(const std::function<const char*(const char*)>& environment);

/// Makes this process part of its job, if it was started as part of one, for as long as this
/// object lives: one a program, in main(). Else MPI is not touched.
class Session {
 public:
  Session();
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  const Communicator& communicator() const { return communicator_; }
  /// Ends all processes at once: for faults of one that the others do not know of. Returns
  /// if this process is alone.
  void abort(int status) const;

 private:
  Communicator communicator_;
};

}  // namespace tomofield::distributed
