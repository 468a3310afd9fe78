#pragma once

#include <memory>
#include <span>
#include <vector>

#include "distributed/communicator.h"
#include "geometry/view_correction.h"
#include "tilt_series/masks/mask_metrics.h"
#include "tilt_series/planned_series.h"

namespace tomofield::tilt_series {

struct Survey;

/// A tilt series every view of which has been decoded, checked and measured, and given up again:
/// for checks, plans and estimates.
class MeasuredSeries : public PlannedSeries {
 public:
  /// Throws Error that names the file and the section; warnings go to base/log.h. Of several
  /// processes each decodes some of the views.
  explicit MeasuredSeries(
      const TiltSeriesOptions& options,
      const distributed::Communicator& processes = distributed::Communicator::alone());
  ~MeasuredSeries();
  MeasuredSeries(MeasuredSeries&&) noexcept;

  /// Returns the standard deviation of each view's noise, in the units of TiltSeries::read_view().
  /// Beads, also undecided ones, are left out.
  const std::vector<double>& noise_sigma() const;

  /// Returns the intensity of an empty beam (I0), in the stack's units; for
  /// kBright 0, where none is needed.
  double empty_beam() const;

  /// Returns the intensity of the emptiest places of a bright series (intensity.h), in the units of
  /// TiltSeries::read_view(); 0 for kDark.
  double background() const;

  const MaskMetrics& mask_metrics() const;

  /// Returns the discs of undecided beads in each view, in the pixels of TiltSeries::read_view().
  const std::vector<std::vector<MaskDisc>>& undecided_beads() const;

 protected:
  explicit MeasuredSeries(std::unique_ptr<const Survey> survey);
  const Survey& survey() const { return *survey_; }

 private:
  std::unique_ptr<const Survey> survey_;
};

}  // namespace tomofield::tilt_series
