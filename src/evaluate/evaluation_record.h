#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "evaluate/artefacts.h"
#include "evaluate/contrast.h"
#include "evaluate/matching/picks.h"
#include "evaluate/reprojection.h"
#include "evaluate/resolution/fsc.h"
#include "evaluate/sheet_filter.h"
#include "evaluate/similarity.h"

// The scores of a volume as a file of metrics has them (JSON).
namespace tomofield::evaluate {

/// Returns the comparison as JSON. An infinite PSNR is written as null.
nlohmann::json comparison_json(const Comparison& comparison,
                               const std::filesystem::path& reconstruction,
                               const std::filesystem::path& truth);

/// Returns the correlation as JSON. A crossing that does not exist and an empty shell are null.
nlohmann::json fsc_json(const Fsc& fsc, const FscFiles& files);

/// Returns the score of membranes (membrane_score()) against `label` as JSON.
nlohmann::json membrane_json(const DetectionScore& score, const std::filesystem::path& label);

/// Returns the scores of picks (pick_score()) against the particles of `list` as JSON.
nlohmann::json picks_json(const std::vector<PickScore>& scores, const std::filesystem::path& list);

/// Returns a reprojection error as JSON. Noise, scales and offsets are in the units of the stack.
nlohmann::json volume_score_json(const VolumeScore& score, const VolumeScoreOptions& options);

/// Returns the contrast of these regions as JSON.
nlohmann::json contrast_json(const ContrastScore& score, const Regions& regions);

/// Returns {speckle, face_jump: {both, x, y}}; what there is not is null.
nlohmann::json artefacts_json(const std::optional<double>& speckle,
                              const std::optional<FaceJump>& faces);

}  // namespace tomofield::evaluate
