#include "prior/answer.h"

#include <algorithm>
#include <functional>
#include <numeric>
#include <utility>
#include <vector>

#include "base/check.h"
#include "base/trace.h"

namespace tomofield::prior {
namespace {

using base::Range;

// Vertices beyond the ends of the lattice, where there are mirror images.
constexpr int kMirrored = 8;

int rounded_up(int count) {
  constexpr int kUnit = Network::kSideUnit;
  return (count + kUnit - 1) / kUnit * kUnit;
}

// Divides a range into parts of about the same length, at most `size`.
std::vector<Range> parts(Range range, int size) {
  std::vector<Range> all;
  const int count = (range.size() + size - 1) / size;
  const int length = count > 0 ? rounded_up((range.size() + count - 1) / count) : size;
  for (int first = range.begin; first < range.end; first += length)
    all.push_back({first, std::min(first + length, range.end)});
  return all;
}

// Returns parts of some rows. The last one also has the row on the face of their leaves.
std::vector<Range> parts_of_rows(Range rows, int num_rows, int size) {
  std::vector<Range> all = parts(rows, size);
  if (rows.end < num_rows && !all.empty()) ++all.back().end;
  return all;
}

// Returns a part with what the network's answer to it depends on.
Range widened(Range part, int count) {
  return {std::max(part.begin - Network::kReach, -kMirrored),
          std::min(rounded_up(part.end) + Network::kReach, rounded_up(count) + kMirrored)};
}

struct Work {
  Lattice::Part part, wide;
};

std::vector<Work> works(const BoxShape& lattice, Range rows, const PartSize& size) {
  std::vector<Work> all;
  for (const Range y : parts_of_rows(rows, lattice.ny, size.y))
    for (const Range x : parts({0, lattice.nx}, size.x))
      for (const Range z : parts({0, lattice.nz}, size.z))
        all.push_back(
            {{x, z, y}, {widened(x, lattice.nx), widened(z, lattice.nz), widened(y, lattice.ny)}});
  return all;
}

// Adds the sums of the densities of some rows.
void add_rows(const Lattice& lattice, Range rows, std::span<const float> parameters,
              std::span<double> sums) {
  const BoxShape& shape = lattice.shape();
  const Lattice::Part first{{0, 1}, {0, shape.nz}, rows};
  std::vector<float> plane(first.shape().size());
  for (int x = 0; x < shape.nx; ++x) {
    lattice.read(parameters, {{x, x + 1}, first.z, rows}, plane);
    for (auto value = plane.begin(); value != plane.end(); value += rows.size())
      std::transform(sums.begin(), sums.end(), value, sums.begin(), std::plus<double>());
  }
}

// Copies the part that lies in a wider one.
void copy_part(const Lattice::Part& wide, std::span<const float> from, const Lattice::Part& part,
               std::span<float> to) {
  float* out = to.data();
  for (int x = part.x.begin; x < part.x.end; ++x) {
    for (int z = part.z.begin; z < part.z.end; ++z, out += part.y.size()) {
      const std::ptrdiff_t row =
          std::ptrdiff_t{x - wide.x.begin} * wide.z.size() + (z - wide.z.begin);
      std::copy_n(from.data() + row * wide.y.size() + (part.y.begin - wide.y.begin), part.y.size(),
                  out);
    }
  }
}

}  // namespace

float mean_density(const Lattice& lattice, Range own, std::span<const float> parameters,
                   const distributed::Communicator& processes) {
  std::vector<double> sums(static_cast<std::size_t>(lattice.shape().ny));
  add_rows(lattice, own, parameters,
           std::span(sums).subspan(static_cast<std::size_t>(own.begin),
                                   static_cast<std::size_t>(own.size())));
  processes.allreduce_sum(std::span(sums));
  return static_cast<float>(std::accumulate(sums.begin(), sums.end(), 0.0) /
                            static_cast<double>(lattice.shape().size()));
}

void replace_by_answer(const Network& network, const Lattice& lattice, const AnsweredRows& own,
                       std::span<float> smooth, std::span<const float> light,
                       const PartSize& size) {
  TOMOFIELD_CHECK(own.rows.begin % Network::kSideUnit == 0, "every part halves the same pairs");
  const base::TraceSpan span("answer of the prior");
  std::vector<float> wide_smooth, wide_light;
  // A part is written after the last one that reads it: all answers are kept until then.
  std::vector<std::pair<Lattice::Part, std::vector<float>>> answers;
  for (const Work& work : works(lattice.shape(), own.rows, size)) {
    wide_smooth.resize(work.wide.shape().size());
    wide_light.resize(work.wide.shape().size());
    lattice.read(smooth, work.wide, wide_smooth);
    lattice.read(light, work.wide, wide_light);
    for (float& value : wide_smooth) value -= own.mean;
    for (float& value : wide_light) value -= own.mean;
    network.apply(work.wide.shape(), wide_smooth, wide_light);
    std::vector<float> answer(work.part.shape().size());
    copy_part(work.wide, wide_smooth, work.part, answer);
    for (float& value : answer) value += own.mean;
    answers.emplace_back(work.part, std::move(answer));
  }
  for (const auto& [part, answer] : answers) lattice.write(answer, part, smooth);
}

std::size_t answer_memory(const BoxShape& lattice, Range rows) {
  std::size_t most = 0, answers = 0;
  for (const Work& work : works(lattice, rows, {})) {
    most = std::max(
        most, Network::memory(work.wide.shape()) + 2 * work.wide.shape().size() * sizeof(float));
    answers += work.part.shape().size() * sizeof(float);
  }
  return most + answers;
}

}  // namespace tomofield::prior
