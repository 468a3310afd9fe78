#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tomofield/error.h"

namespace tomofield::distributed {

/// An Error that all ranks of a job throw together, with the same message
/// (Communicator::run_collectively). Every rank can then end in order, and the root reports
/// the message once.
class SharedError : public Error {
 public:
  using Error::Error;
};

/// Connects the ranks (processes) of a job: this process alone, or all processes that mpirun or
/// srun started together (Session).
///
/// Every rank makes the same collective calls in the same order. In a job of one rank, the
/// collective calls do nothing. Only the thread that started the process may call.
///
/// Results do not depend on the order in which messages arrive: arrays are summed such that each
/// element has one owner and all other ranks contribute 0. Results therefore have the same bits for
/// any number of ranks.
class Communicator {
 public:
  /// Returns the communicator of a job of one rank.
  static const Communicator& alone();

  int rank() const { return rank_; }  ///< 0 <= rank < size
  int size() const { return size_; }
  /// Returns true on the root, rank 0, which reports to the user and writes what the ranks do not
  /// share.
  bool is_root() const { return rank_ == 0; }
  /// Returns the number of ranks on this machine, this one included.
  int size_on_machine() const { return size_on_machine_; }

  /// Replaces `values` on every rank by the sum over all ranks, element by element. To keep results
  /// independent of the number of ranks, an element must be 0 on every rank but its owner. T is
  /// float, double or std::int64_t.
  template <typename T>
  void allreduce_sum(std::span<T> values) const;
  /// Sums structs over all ranks. `member` and `more` name the members to sum, which all have type
  /// T; other members stay as they are.
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
  /// Returns the largest of the values that the ranks hand over.
  double allreduce_max(double value) const;
  /// Broadcasts the bytes of rank `owner` to all ranks; `bytes` has the same size everywhere.
  void broadcast(std::span<std::byte> bytes, int owner) const;
  /// Broadcasts the text of rank `owner` and returns it on all ranks.
  std::string broadcast(std::string text, int owner = 0) const;

  /// The arrays that a rank exchanges with its neighbours, which are the ranks before and after it.
  /// Both spans towards a neighbour that does not exist are empty.
  struct Halo {
    std::span<const float> to_before, to_after;
    std::span<float> from_before, from_after;
  };
  /// Sends `to_before` and `to_after` to the neighbours, and receives `from_before` and
  /// `from_after` from them.
  void exchange(const Halo& halo) const;

  /// Sends `values` to rank `to`, which must receive as many. T is float or std::int64_t.
  template <typename T>
  void send(std::span<const T> values, int to) const;
  /// A message that is being sent. The destructor waits until that is done.
  class Sending {
   public:
    Sending(Sending&&) noexcept;
    Sending& operator=(Sending&&) = delete;
    ~Sending();

   private:
    friend class Communicator;
    struct State;
    explicit Sending(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
  };
  /// Starts to send `values` to rank `to`, which must receive as many. Nothing is sent if there are
  /// none.
  [[nodiscard]] Sending start_sending(std::vector<float> values, int to) const;
  /// Waits for values that rank `from` sends, and fills `values` with them.
  template <typename T>
  void receive(std::span<T> values, int from) const;

  /// Runs `body` on every rank. If it throws Error on some ranks, all ranks throw SharedError with
  /// the message of the lowest of them. `body` must not make collective calls, because a rank that
  /// throws would not join them. A job of one rank throws the Error itself.
  void run_collectively(const std::function<void()>& body) const;

  /// Sets a function that is called now and then while this rank waits long for others.
  void set_waiting_callback(std::function<void()> check) const { check_ = std::move(check); }

  /// The bytes that this rank has sent, and the seconds for which it has waited for others, since
  /// the job started.
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

/// Returns true if mpirun or srun started this process as one of several. The environment tells.
bool is_part_of_a_job(const std::function<const char*(const char*)>& environment);

/// Connects this process to its job for as long as the object lives. A program makes one, in
/// main(). MPI is not touched if the process was not started as part of a job. Throws Error if it
/// was, but MPI sees only this process.
class Session {
 public:
  Session();
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  const Communicator& communicator() const { return communicator_; }
  /// Ends all ranks at once, for a failure on this rank that the others do not know of. Returns if
  /// this process is alone.
  void abort(int status) const;

 private:
  Communicator communicator_;
};

}  // namespace tomofield::distributed
