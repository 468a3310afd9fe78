#pragma once

#include <string>
#include <utility>
#include <vector>

#include "compare/comparison.h"
#include "compare/runs.h"
#include "compare/table.h"
#include "report/curve_plot.h"

namespace tomofield::compare {

/// What the report shows of the scores beside the table.
struct Scores {
  std::string remark;  ///< what has to be known about the table
  /// Shell correlations: what is correlated, and a curve a method.
  std::vector<std::pair<std::string, std::vector<report::Curve>>> correlations;
};

/// Adds the columns of scores to a table with a row a method: against the truth if there is one,
/// PSNR, SSIM and where the shell correlation falls to 0.5; contrast (CNR, ENL) on regions that
/// are chosen on the main method's volume; with halves, where the correlation of the two falls to
/// 0.143; and the error of views held out. `rows` are [purpose][method].
Scores add_scores(const CompareOptions& options, const std::vector<Purpose>& purposes,
                  const std::vector<Row>& rows, Table& table);

}  // namespace tomofield::compare
