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

/// The scores of a volume. Those that nobody asked for are absent.
struct EvaluationRecord {
  struct WithTruth {
    Comparison scores;
    std::filesystem::path truth;
  };
  struct WithOther {
    Fsc fsc;
    FscFiles files;
  };
  struct WithLabel {
    DetectionScore score;
    std::filesystem::path label;
  };
  struct WithParticles {
    std::vector<PickScore> scores;
    std::filesystem::path list;
  };
  struct WithViews {
    VolumeScore score;
    VolumeScoreOptions options;
  };
  struct OfRegions {
    ContrastScore score;
    Regions regions;
    bool are_chosen = false;  ///< else somebody gave them
  };

  std::filesystem::path volume;
  std::optional<WithTruth> comparison = {};
  std::optional<WithOther> correlation = {};
  std::optional<WithLabel> membranes = {};
  std::optional<WithParticles> picks = {};
  std::optional<WithViews> reprojection = {};
  std::optional<OfRegions> contrast = {};
  std::optional<double> speckle = {};
  std::optional<FaceJump> faces = {};
};

/// Writes the scores. An infinite PSNR is written as null.
void write_record(const std::filesystem::path& file, const EvaluationRecord& record);

/// Returns the correlation as JSON. A crossing that does not exist and an empty shell are null.
nlohmann::json fsc_json(const Fsc& fsc, const FscFiles& files);

/// Returns {speckle, face_jump: {both, x, y}}; what there is not is null.
nlohmann::json artefacts_json(const std::optional<double>& speckle,
                              const std::optional<FaceJump>& faces);

}  // namespace tomofield::evaluate
