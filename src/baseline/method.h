#pragma once

#include <optional>
#include <variant>

#include "baseline/classical/sart_tv.h"
#include "baseline/classical/sirt.h"
#include "baseline/classical/tv_reconstruction.h"
#include "baseline/classical/wbp.h"
#include "baseline/neural/network_methods.h"
#include "baseline/solver.h"
#include "baseline/voxel_problem.h"

namespace tomofield::baseline {

/// The options of one of the methods. Each has facts(), an overload of reconstruct_with() in
/// method.cc, one of fields_of() in baseline_record.cc and one of rows_of() in method_options.cc.
/// docs/architecture.md lists what else a new method needs.
using Method =
    std::variant<WbpOptions, SirtOptions, SartTvOptions, TvOptions, IngpOptions, FourierNetOptions>;

MethodFacts facts_of(const Method& method);
/// Returns the size of a method. Every voxel is a parameter unless its options have a size().
MethodSize size_of(const Method& method, const projection::SampleGrid& grid, std::int64_t num_rows);
/// Reconstructs with a method. `mean_density` is the specimen's, in density units.
Solution reconstruct(VoxelProblem& problem, const Method& method, double mean_density,
                     const AfterIteration& after_iteration);

/// Returns the fall of the objective in the last tenth of the iterations, as a fraction of the
/// objective. Returns nothing for a method that does not iterate.
std::optional<double> last_decrease(const Solution& solution);

}  // namespace tomofield::baseline
