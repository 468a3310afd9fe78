#include <nlohmann/json.hpp>

#include "option_table/values.h"
#include "reconstruct/options.h"

namespace tomofield::reconstruction {

nlohmann::json options_json(const ReconstructOptions& options) {
  nlohmann::json all = option_table::to_json(options.files, options.resolved);
  all.erase("running");  // says where the results are, not what they are made from
  all["choose_penalty"] = options.choose_penalty;
  const fit::FieldOptions& field = options.field;
  all["field"].update({{"depth", field.depth},
                       {"margin_rank", field.margin_rank},
                       {"sharpness", field.sharpness},
                       {"initial_scale", field.initial_scale}});
  const fit::FitOptions& fit = options.fit;
  all["fit"].update({{"final_rate", fit.final_rate},
                     {"coarse_final_rate", fit.coarse_final_rate},
                     {"refined_rate", fit.refined_rate},
                     {"vertex_rate", fit.vertex_rate},
                     {"factorised_rate", fit.factorised_rate},
                     {"concavity", fit.concavity},
                     {"gradient_floor", fit.gradient_floor}});
  return all;
}

}  // namespace tomofield::reconstruction
