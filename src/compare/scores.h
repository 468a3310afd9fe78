#pragma once

#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compare/comparison.h"
#include "compare/runs.h"
#include "compare/table.h"
#include "report/curve_plot.h"

namespace tomofield::compare {

/// Returns the row on whose volume regions and details are chosen: SIRT's, which has no prior, or
/// else the last one, so that the main method does not choose what it is scored on unless it is
/// alone.
std::size_t reference_row(std::span<const Row> rows);

/// The scores that the report shows beside the table.
struct Scores {
  std::string remark;  ///< the note below the table
  /// Shell correlations: a title and a curve a method.
  std::vector<std::pair<std::string, std::vector<report::Curve>>> correlations;
};

/// Adds the columns of scores to a table with a row a method. If there is a truth, these are PSNR,
/// SSIM and the resolution at which the shell correlation with it falls to 0.5. Contrast (CNR, ENL)
/// is measured on the given regions, or on some that are chosen on the reference's volume. Speckle
/// is added, and the face jump of methods that have leaves. With halves, the resolution at which
/// their correlation falls to 0.143 is added; with held-out views, their error. `rows` are
/// [purpose][method].
Scores add_scores(const CompareOptions& options, const std::vector<Purpose>& purposes,
                  const std::vector<Row>& rows, Table& table);

}  // namespace tomofield::compare
