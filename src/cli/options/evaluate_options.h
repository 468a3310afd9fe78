#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <vector>

#include "evaluate/box.h"
#include "evaluate/contrast.h"
#include "evaluate/profile.h"
#include "evaluate/resolution/fsc.h"
#include "io/saving/output_lock.h"
#include "option_table/values.h"

namespace tomofield::cli {

/// The arguments of `evaluate`.
struct EvaluateArguments {
  std::filesystem::path volume;
  std::optional<std::filesystem::path> truth;
  std::optional<base::Box> box;

  std::optional<std::filesystem::path> fsc_with, fsc_mask, fsc_csv, fsc_picture;
  std::optional<evaluate::TiltRange> tilts;

  std::optional<std::filesystem::path> membranes, particles;

  bool contrast = false;
  evaluate::Regions regions;  ///< empty: chosen automatically

  std::optional<std::filesystem::path> model;  ///< default: the one beside the volume

  std::optional<evaluate::LineSegment> profile;
  std::optional<std::filesystem::path> profile_csv;

  std::optional<std::filesystem::path> series;
  option_table::Choices choices;  ///< options of `series`
  int hold_out = 0;

  std::optional<std::filesystem::path> json;
  bool overwrite = false;

  /// Checks the arguments and locks the outputs. Throws Error for options that need others, and for
  /// outputs that must not be written.
  std::vector<io::OutputLock> claim_outputs() const;
};

/// Registers all options of `evaluate`. `arguments` must outlive the parsing.
void add_evaluate_options(CLI::App& command, EvaluateArguments& arguments);

}  // namespace tomofield::cli
