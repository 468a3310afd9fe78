#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace tomofield::evaluate {

/// A found thing: how sure its finder is, and whether it is real.
struct Detection {
  float score = 0.0f;
  bool is_true = false;
};

/// How well scores tell true things from false ones.
struct DetectionScore {
  double average_precision = 0.0;
  double best_dice = 0.0;       ///< largest 2 hits / (taken + true) over all thresholds
  double best_threshold = 0.0;  ///< the score from which on detections are taken there
};

/// Scores detections from the highest score down. The average precision is Σ precision · (gain of
/// recall) over the thresholds (as in scikit-learn), where the recall is the share of `num_true`
/// things that were taken. Equal scores are taken together. `num_true` counts true things that were
/// not found as well; it is at least the number of true detections and above 0, or all scores are
/// 0.
DetectionScore score_detections(std::vector<Detection> detections, std::size_t num_true);

}  // namespace tomofield::evaluate
