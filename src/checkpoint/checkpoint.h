#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "checkpoint/origin_record.h"
#include "distributed/communicator.h"
#include "fit/fit.h"
#include "measurement/measurement.h"
#include "options/run_options.h"
#include "output/model_file.h"

namespace tomofield::checkpoint {

/// Returns the metadata of a fitted model: geometry, region, units, contrast and options.
output::ModelInfo model_info(const measurement::Measurement& series,
                             const options::ReconstructOptions& options);

/// Return a text as the numbers that a training state holds, and the reverse.
std::vector<std::int64_t> as_numbers(const std::string& text);
std::string as_text(const std::vector<std::int64_t>& numbers);

/// Returns the progress of a fit in the form of the model file, without the optimiser. A finished
/// model has this state.
output::TrainingState progress_state(const fit::Fit& fit, const FitOrigin& origin);

/// Writes the model of a finished fit with the state that progress_state() returned. Every process
/// that shares the fit calls it; the root writes the file.
void save_fit(const std::filesystem::path& path, const fit::Fit& fit, const output::ModelInfo& info,
              const output::TrainingState& state);

/// Writes the model of a fit between two steps with the state of the optimiser. Any number of
/// processes can continue it bit for bit. The file is three times as large as a model. Every
/// process that shares the fit calls it; the root writes the file.
void save_checkpoint(const std::filesystem::path& path, const fit::Fit& fit,
                     const output::ModelInfo& info, const FitOrigin& origin);

/// Returns the trials that chose options of the fit in a checkpoint or model, if any did. Throws
/// Error if `path` is neither.
std::optional<tune::TunedFit> stored_choice(const std::filesystem::path& path);

/// Returns FitOrigin::tile_rows of the fit in a checkpoint, if the memory that was free decided
/// them, or in finished tiles. Throws Error if `path` is neither.
std::optional<int> stored_tile_rows(const std::filesystem::path& path);

/// Throws Error if `path` is a model without the state of a fit, such as a compact one, which no
/// run can continue.
void require_state_of_fit(const std::filesystem::path& path);

/// Continues a stored fit: puts its field and its state into a new fit with the same options. Each
/// process reads the parameters that it needs. Throws Error if `path` belongs to another series or
/// to other options, and names what differs.
void restore_fit(const std::filesystem::path& path, const std::string& fingerprint, fit::Fit& fit);

/// Calls a function that reads the checkpoint. If it throws, adds what the user can do.
void read_checkpoint(const std::function<void()>& read);

}  // namespace tomofield::checkpoint
