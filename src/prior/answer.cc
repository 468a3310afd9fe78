#include "prior/answer.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "base/parallel.h"
#include "base/trace.h"

namespace tomofield::prior {
namespace {

using base::Range;

// Vertices beyond the ends of the lattice, where there are mirror images.
constexpr int kMirrored = 8;

std::vector<Range> parts(int count, int size) {
  std::vector<Range> all;
  for (int first = 0; first < count; first += size)
    all.push_back({first, std::min(first + size, count)});
  return all;
}

int rounded_up(int count) {
  constexpr int kUnit = Network::kSideUnit;
  return (count + kUnit - 1) / kUnit * kUnit;
}

// Returns a part with what the network's answer to it depends on.
Range widened(Range part, int count) {
  return {std::max(part.begin - Network::kReach, -kMirrored),
          std::min(rounded_up(part.end) + Network::kReach, rounded_up(count) + kMirrored)};
}

struct Work {
  Lattice::Part part, wide;
};

std::vector<Work> works(const BoxShape& lattice, const PartSize& size) {
  std::vector<Work> all;
  for (const Range y : parts(lattice.ny, size.y))
    for (const Range x : parts(lattice.nx, size.x))
      for (const Range z : parts(lattice.nz, size.z))
        all.push_back(
            {{x, z, y}, {widened(x, lattice.nx), widened(z, lattice.nz), widened(y, lattice.ny)}});
  return all;
}

// Returns the mean of a lattice, summed in a fixed order.
double mean_of(const Lattice& lattice, std::span<const float> parameters) {
  const BoxShape& shape = lattice.shape();
  std::vector<double> sums;
  std::vector<float> row(static_cast<std::size_t>(shape.nz) * static_cast<std::size_t>(shape.ny));
  for (int x = 0; x < shape.nx; ++x) {
    lattice.read(parameters, {{x, x + 1}, {0, shape.nz}, {0, shape.ny}}, row);
    sums.push_back(std::accumulate(row.begin(), row.end(), 0.0));
  }
  return std::accumulate(sums.begin(), sums.end(), 0.0) / static_cast<double>(shape.size());
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

void replace_by_answer(const Network& network, const Lattice& lattice, std::span<float> smooth,
                       std::span<const float> light, const PartSize& size) {
  const base::TraceSpan span("answer of the prior");
  const auto mean = static_cast<float>(mean_of(lattice, smooth));
  std::vector<float> wide_smooth, wide_light;
  // A part is written after the last one that reads it: all answers are kept until then.
  std::vector<std::pair<Lattice::Part, std::vector<float>>> answers;
  for (const Work& work : works(lattice.shape(), size)) {
    wide_smooth.resize(work.wide.shape().size());
    wide_light.resize(work.wide.shape().size());
    lattice.read(smooth, work.wide, wide_smooth);
    lattice.read(light, work.wide, wide_light);
    for (float& value : wide_smooth) value -= mean;
    for (float& value : wide_light) value -= mean;
    network.apply(work.wide.shape(), wide_smooth, wide_light);
    std::vector<float> answer(work.part.shape().size());
    copy_part(work.wide, wide_smooth, work.part, answer);
    for (float& value : answer) value += mean;
    answers.emplace_back(work.part, std::move(answer));
  }
  for (const auto& [part, answer] : answers) lattice.write(answer, part, smooth);
}

std::size_t answer_memory(const BoxShape& lattice) {
  std::size_t most = 0;
  for (const Work& work : works(lattice, {}))
    most = std::max(
        most, Network::memory(work.wide.shape()) + 2 * work.wide.shape().size() * sizeof(float));
  return most + lattice.size() * sizeof(float);
}

}  // namespace tomofield::prior
