#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "align/alignment.h"
#include "options/run_options.h"
#include "tilt_series/planned_series.h"

namespace tomofield::realign {

// The record of an alignment (NAME_align.json) says what was found for each view, and what from.

/// Returns what an alignment is made from: the options that decide what it finds (`made_with`), and
/// the series (`series`): its sections and their size, and checksums of its small files and of the
/// pixels of three views. A copy of the series has the same. Throws Error if a file cannot be read.
nlohmann::json alignment_origin(const options::ReconstructOptions& options);

/// Returns the record of an alignment, without its origin.
nlohmann::json alignment_record(const tilt_series::PlannedSeries& series,
                                const align::Alignment& found, double seconds);

/// Adds the views that were left out before `found` was made to the record of the others, with how
/// they agreed in `first`, the alignment of all views of `series`.
void add_left_out(const tilt_series::PlannedSeries& series, const align::Alignment& first,
                  nlohmann::json& record);

/// Reads the record that a run resumes from. Throws Error if it is damaged, or made from something
/// else than `origin`.
nlohmann::json read_alignment_record(const std::filesystem::path& path,
                                     const nlohmann::json& origin);

/// Puts the corrections of a record into the options of the run.
void apply_alignment(const nlohmann::json& record, options::ReconstructOptions& options);

}  // namespace tomofield::realign
