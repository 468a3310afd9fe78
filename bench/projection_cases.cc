#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <numeric>

#include "base/aligned_buffer.h"
#include "base/random.h"
#include "bench/cases.h"
#include "bench/load_bound.h"
#include "bench/projection_setup.h"
#include "kernels/lanes.h"

namespace tomofield::bench {

using kernels::kLanes;

std::vector<Case> projection_cases() {
  const auto setup = std::make_shared<ProjectionSetup>(64, 1, kSlabsTogether);
  const auto alone = std::make_shared<ProjectionSetup>(64, 1, 1);
  return {setup->forward_case(kForward, setup), setup->adjoint_case(kAdjoint, setup),
          alone->forward_case(kForwardAlone, alone), alone->adjoint_case(kAdjointAlone, alone)};
}

std::vector<Case> load_bound_cases() {
  struct Loads {
    base::AlignedBuffer<float> samples;
    float sink = 0;
  };
  const auto loads = [](const char* name, std::size_t bytes) {
    const auto data = std::make_shared<Loads>();
    data->samples.reset(bytes / sizeof(float));
    constexpr std::ptrdiff_t kUpdates = 1 << 16;
    return Case{.name = name,
                .run =
                    [data] {
                      data->sink +=
                          load_two_samples(data->samples.data(), data->samples.size(), kUpdates);
                    },
                .updates = kUpdates * kLanes,
                .done = kUpdates * kLanes,
                .flops = 4.0 * kUpdates * kLanes,
                .bytes = 8.0 * kUpdates * kLanes};
  };
  return {loads(kLoadL1, 16 << 10), loads(kLoadL2, 256 << 10)};
}

}  // namespace tomofield::bench
