#include "evaluate/matching/detection.h"

#include <algorithm>
#include <functional>

namespace tomofield::evaluate {

DetectionScore score_detections(std::vector<Detection> detections, std::size_t num_true) {
  DetectionScore result;
  if (num_true == 0) return result;
  std::ranges::sort(detections, std::greater<>(), &Detection::score);
  const auto all_true = static_cast<double>(num_true);
  double hits = 0.0;
  for (std::size_t i = 0; i < detections.size();) {
    const float threshold = detections[i].score;
    const double hits_before = hits;
    for (; i < detections.size() && detections[i].score == threshold; ++i)
      hits += detections[i].is_true ? 1.0 : 0.0;
    const auto taken = static_cast<double>(i);
    result.average_precision += hits / taken * (hits - hits_before) / all_true;
    const double dice = 2.0 * hits / (taken + all_true);
    if (dice > result.best_dice) {
      result.best_dice = dice;
      result.best_threshold = static_cast<double>(threshold);
    }
  }
  return result;
}

}  // namespace tomofield::evaluate
