#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "align/alignment.h"
#include "align/freedoms.h"
#include "align/joint_alignment.h"
#include "align/trial.h"
#include "geometry/view_correction.h"
#include "geometry/view_warp.h"
#include "tilt_series/planned_series.h"

namespace tomofield::alignment {

/// Identifies what an alignment is made from. A copy of the series has the same origin. Checksums
/// are in hexadecimal.
struct AlignmentOrigin {
  std::int64_t num_sections = 0;                  ///< of the stack
  std::array<std::int64_t, 2> size_px{};          ///< width and height of a section
  std::map<std::string, std::string> files = {};  ///< checksums of small files, by their options
  std::string header_tilts = {};                  ///< checksum of the tilts in the stack's header
  std::string pixels = {};                        ///< checksum of the pixels of three sections
  nlohmann::json made_with = {};                  ///< the options that decide what is found
  bool operator==(const AlignmentOrigin&) const = default;
};

/// Describes how an alignment changes the alignment of one view that the files give, in pixels
/// before binning.
struct AlignedView {
  std::int64_t section = 0;  ///< of the stack, from 0
  double tilt_deg = 0.0;     ///< as the files state it
  std::array<double, 2> shift_px{};
  double rotation_deg = 0.0;
  double log_magnification = 0.0;
  double tilt_change_deg = 0.0;
  std::optional<geometry::ViewWarp> local = {};  ///< local motion
  ViewAgreement agreement = {};                  ///< with its projection
  bool is_left_out = false;                      ///< it does not resemble the specimen

  geometry::ViewCorrection correction() const;
  bool operator==(const AlignedView&) const = default;
};

/// Tells how far gold beads lie from their places: the root mean square in x and y, in pixels
/// before binning.
struct BeadRecord {
  std::int64_t num_beads = 0;
  double files_px = 0.0;                   ///< with the alignment of the files
  double before_px = 0.0, after_px = 0.0;  ///< with the new one, before and after beads were used
  base::MeanGain gain = {};                ///< the part by which the squared distances fell
  bool is_accepted = false;                ///< whether the new alignment uses them
};

/// The search for local motion.
struct LocalRecord {
  LocalTrial trial = {};
  std::array<double, 2> size_px{};  ///< of the views, if it was accepted
  double rms_px = 0.0;              ///< of the motion, if it was accepted
};

/// The record of an alignment (NAME_align.json) tells what was found for each view, and from what.
struct AlignmentRecord {
  AlignmentOrigin origin = {};
  bool is_accepted = false;  ///< else the alignment of the files is kept
  Freedoms freedoms = {};
  Comparison held_out = {};
  std::vector<double> steps_px = {};  ///< JointAlignment::steps_px
  double seconds = 0.0;
  std::optional<FoundPose> pose = {};
  std::optional<BeadRecord> beads = {};
  std::optional<LocalRecord> local = {};
  std::vector<AlignedView> views = {};  ///< in ascending order of sections
};

/// Returns the record of an alignment of `series`, which took `seconds`.
AlignmentRecord make_record(AlignmentOrigin origin, const tilt_series::PlannedSeries& series,
                            const Alignment& found, double seconds);

/// Adds the views that were left out before the alignment was made to its record, with how they
/// agreed in `first`, the alignment of all views of `series`.
void add_left_out(const tilt_series::PlannedSeries& series, const Alignment& first,
                  AlignmentRecord& record);

/// Writes what an alignment is made from: the entries `series` and `made_with` of its record.
nlohmann::json to_json(const AlignmentOrigin& origin);
/// Reads it. Throws Error with what is wrong if no alignment could have written it.
AlignmentOrigin origin_from(const nlohmann::json& json);
std::string text_of(const AlignmentOrigin& origin);
AlignmentOrigin origin_from_text(const std::string& text);

/// Returns a sentence that says how an alignment's origin is another one than is wanted: "it was
/// made from another series: its images or its files are not the same". It is empty if both are the
/// same.
std::string difference_of(const AlignmentOrigin& found, const AlignmentOrigin& wanted);

/// Writes a record.
nlohmann::json to_json(const AlignmentRecord& record);
/// Reads a record that somebody may have changed. Throws Error with what is wrong if no alignment
/// could have written it. What is read is what was written, to the bit.
AlignmentRecord record_from(const nlohmann::json& json);

/// Writes and reads the file of a record, NAME_align.json. The reader throws Error as record_from()
/// does, without the name of the file.
void write_record(const std::filesystem::path& file, const AlignmentRecord& record);
AlignmentRecord read_record(const std::filesystem::path& file);

}  // namespace tomofield::alignment
