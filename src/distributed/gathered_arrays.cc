#include "distributed/gathered_arrays.h"

#include <algorithm>
#include <array>
#include <cstdint>

namespace tomofield::distributed {
namespace {

constexpr std::size_t kPiece = std::size_t{1} << 20;

// A request of the root for [first, end) of an array; array −1 ends the service.
struct Request {
  std::int64_t array = -1, first = 0, end = 0;
};
using Words = std::array<std::int64_t, 3>;

void send(const Communicator& processes, const Request& request, int to) {
  const Words words{request.array, request.first, request.end};
  processes.send(std::span<const std::int64_t>(words), to);
}

Request receive(const Communicator& processes) {
  Words words{};
  processes.receive(std::span<std::int64_t>(words), 0);
  return {words[0], words[1], words[2]};
}

}  // namespace

GatheredArrays::GatheredArrays(const Communicator& processes, std::size_t first, std::size_t end)
    : processes_(processes) {
  std::vector<std::int64_t> firsts(static_cast<std::size_t>(processes.size()) + 1);
  firsts[static_cast<std::size_t>(processes.rank())] = static_cast<std::int64_t>(first);
  if (processes.rank() + 1 == processes.size()) firsts.back() = static_cast<std::int64_t>(end);
  processes.allreduce_sum(std::span(firsts));
  limits_.assign(firsts.begin(), firsts.end());
}

std::size_t GatheredArrays::add(std::span<const float> values) {
  arrays_.push_back(values);
  return arrays_.size() - 1;
}

void GatheredArrays::read_on_root(const std::function<void()>& body) const {
  processes_.run_collectively([&] {
    if (!processes_.is_root()) return answer();
    // Releases the other ranks from waiting, also if the body throws.
    struct Dismissal {
      const Communicator& processes;
      ~Dismissal() {
        for (int rank = 1; rank < processes.size(); ++rank) send(processes, {}, rank);
      }
    } const dismissal{processes_};
    body();
  });
}

void GatheredArrays::hand_out(std::size_t array, const Sink& sink) const {
  std::vector<float> piece;
  for (int rank = 0; rank < processes_.size(); ++rank) {
    const std::size_t end = limits_[static_cast<std::size_t>(rank) + 1];
    for (std::size_t at = limits_[static_cast<std::size_t>(rank)]; at < end; at += kPiece) {
      const std::size_t piece_end = std::min(at + kPiece, end);
      if (rank == 0) {
        sink(arrays_[array].subspan(at, piece_end - at));
        continue;
      }
      send(processes_,
           {static_cast<std::int64_t>(array), static_cast<std::int64_t>(at),
            static_cast<std::int64_t>(piece_end)},
           rank);
      piece.resize(piece_end - at);
      processes_.receive(std::span(piece), rank);
      sink(piece);
    }
  }
}

void GatheredArrays::answer() const {
  for (Request r = receive(processes_); r.array >= 0; r = receive(processes_)) {
    const auto values = arrays_[static_cast<std::size_t>(r.array)].subspan(
        static_cast<std::size_t>(r.first), static_cast<std::size_t>(r.end - r.first));
    processes_.send(values, 0);
  }
}

}  // namespace tomofield::distributed
