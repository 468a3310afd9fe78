#include "tilt_series/measured_series.h"

#include <utility>

#include "tilt_series/survey.h"

namespace tomofield::tilt_series {

MeasuredSeries::MeasuredSeries(const TiltSeriesOptions& options,
                               const distributed::Communicator& processes)
    : MeasuredSeries(std::make_unique<const Survey>(
          survey_views(PlannedSeries(options, processes), processes).survey)) {}
MeasuredSeries::MeasuredSeries(std::unique_ptr<const Survey> survey)
    : PlannedSeries(survey->series), survey_(std::move(survey)) {}
MeasuredSeries::~MeasuredSeries() = default;
MeasuredSeries::MeasuredSeries(MeasuredSeries&&) noexcept = default;

const std::vector<double>& MeasuredSeries::noise_sigma() const { return survey_->noise_sigma; }
double MeasuredSeries::empty_beam() const { return survey_->intensity.empty_beam; }
double MeasuredSeries::background() const { return survey_->background; }
const MaskMetrics& MeasuredSeries::mask_metrics() const { return survey_->beads.metrics; }
const std::vector<std::vector<MaskDisc>>& MeasuredSeries::undecided_beads() const {
  return survey_->beads.undecided;
}

}  // namespace tomofield::tilt_series
