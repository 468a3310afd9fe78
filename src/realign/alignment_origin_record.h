#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "align/alignment_record.h"
#include "options/run_options.h"

namespace tomofield::realign {

/// Returns what an alignment is made from: the options that decide what it finds, the sections and
/// their size, and checksums of the small files and of the pixels of three views. Throws Error if a
/// file cannot be read.
alignment::AlignmentOrigin alignment_origin(const options::ReconstructOptions& options);

/// Reads the record that a run resumes from. Throws Error if it is damaged, made from something
/// else than `origin`, or not of all `sections` of the series' views, which ascend.
alignment::AlignmentRecord read_alignment_record(const std::filesystem::path& path,
                                                 const alignment::AlignmentOrigin& origin,
                                                 const std::vector<std::int64_t>& sections);

/// Puts the corrections of a record, and the record itself, into the options of the run.
void apply_alignment(const alignment::AlignmentRecord& record,
                     options::ReconstructOptions& options);

}  // namespace tomofield::realign
