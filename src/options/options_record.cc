#include "options/options_record.h"

#include "fit/constants.h"
#include "objective/constants.h"
#include "option_table/values.h"

namespace tomofield::options {

nlohmann::json options_json(const ReconstructOptions& options) {
  nlohmann::json all = option_table::to_json({options.files, options});
  all.erase("running");  // says where the results are, not what they are made from
  constexpr fit::FieldStart kStart;
  all["field"].update({{"depth", fit::depth_of(options.field)},
                       {"margin_rank", fit::kMarginRank},
                       {"sharpness", kStart.sharpness},
                       {"initial_scale", kStart.initial_scale}});
  all["fit"].update({{"final_rate", fit::kFinalRate},
                     {"coarse_final_rate", fit::kCoarseFinalRate},
                     {"refined_rate", fit::kRefinedRate},
                     {"vertex_rate", fit::kVertexRate},
                     {"factorised_rate", fit::kFactorisedRate},
                     {"concavity", objective::kConcavity},
                     {"gradient_floor", objective::kGradientFloor}});
  return all;
}

std::string options_text(const ReconstructOptions& options) { return options_json(options).dump(); }

}  // namespace tomofield::options
