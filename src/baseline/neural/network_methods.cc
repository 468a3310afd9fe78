#include "baseline/neural/network_methods.h"

#include <memory>

#include "baseline/neural/encodings.h"
#include "baseline/neural/network_density.h"

namespace tomofield::baseline {
namespace {

std::unique_ptr<PointEncoding> encoding_of(const IngpOptions& options,
                                           const projection::SampleGrid& samples,
                                           std::int64_t num_rows) {
  return std::make_unique<HashGrid>(box_of(samples, num_rows), options.grid);
}

std::unique_ptr<PointEncoding> encoding_of(const FourierNetOptions& options) {
  // This seed keeps the random numbers of the encoding apart from the network's.
  constexpr std::uint64_t kSeedStep = 1000003;
  return std::make_unique<FourierEncoding>(options.features, options.shortest,
                                           options.seed + kSeedStep);
}

}  // namespace

MethodSize IngpOptions::size(const projection::SampleGrid& samples, std::int64_t num_rows) const {
  return network_size(samples, num_rows, *encoding_of(*this, samples, num_rows), *this);
}

Solution reconstruct_ingp(VoxelProblem& problem, const IngpOptions& options, double mean_density,
                          const AfterIteration& after_iteration) {
  return fit_network(problem, options, encoding_of(options, problem.grid(), problem.num_rows()),
                     mean_density, /*learns_noise=*/false, after_iteration);
}

MethodSize FourierNetOptions::size(const projection::SampleGrid& samples,
                                   std::int64_t num_rows) const {
  return network_size(samples, num_rows, *encoding_of(*this), *this);
}

Solution reconstruct_fourier_net(VoxelProblem& problem, const FourierNetOptions& options,
                                 double mean_density, const AfterIteration& after_iteration) {
  return fit_network(problem, options, encoding_of(options), mean_density, /*learns_noise=*/true,
                     after_iteration);
}

}  // namespace tomofield::baseline
