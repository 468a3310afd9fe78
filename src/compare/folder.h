#pragma once

#include <vector>

#include "compare/comparison.h"
#include "compare/rows.h"

namespace tomofield::compare {

/// Checks the folder of a comparison before anything is written there. Throws Error if a file that
/// the comparison or one of its runs writes would replace or remove a file that one of them reads.
/// Unless `options.overwrite`, throws Error also if a file exists that this comparison has not
/// made: a run has made its files once it has a row there, and the report is of the first row on.
void check_folder(const CompareOptions& options, const std::vector<Row>& rows);

/// Checks the files that the run of a row may write or remove, as its dry run names them, like
/// check_folder().
void check_planned_files(const CompareOptions& options, const std::vector<Row>& rows,
                         const Row& row, const std::vector<std::filesystem::path>& files);

/// Removes all files of the runs and of the report, so that no old report stands beside new
/// volumes, even if the comparison stops before it is finished.
void remove_results(const CompareOptions& options, const std::vector<Row>& rows);

/// Warns of runs in the folder that an older comparison made and this one does not: they stay.
void warn_of_other_runs(const CompareOptions& options, const std::vector<Row>& rows);

}  // namespace tomofield::compare
