#pragma once

#include <memory>

#include "fit/fit.h"
#include "measurement/measurement.h"
#include "output/model_file.h"
#include "sphere_series.h"

namespace tomofield::testing {

/// Makes fits of a small series that all have the same options.
class SmallFit {
 public:
  static constexpr const char* kFingerprint = R"({"fit":{"seed":1},"rays":12})";

  SmallFit() {
    info_.geometry = series_.geometry;
    info_.roi = measurement_.roi;
    field_.kind = FieldKind::kVm;
    field_.leaf_size = 16;
    field_.rank = 2;
    field_.with_margin = false;
    fit_.epochs = 3;
    fit_.subsets = 4;
  }
  std::unique_ptr<fit::Fit> make() const { return make(field_); }
  /// Makes a fit with another field.
  std::unique_ptr<fit::Fit> make(const FieldOptions& field) const {
    return std::make_unique<fit::Fit>(measurement_, field, fit_);
  }
  const FieldOptions& field() const { return field_; }
  const output::ModelInfo& info() const { return info_; }

 private:
  SphereSeries series_;
  measurement::Measurement measurement_{.geometry = series_.geometry,
                                        .roi = {0, 0, SphereSeries::kWidth, SphereSeries::kRows},
                                        .rays = series_.rays,
                                        .noise_sigma = series_.noise_sigma,
                                        .mean_density = 0.1};
  FieldOptions field_;
  FitOptions fit_;
  output::ModelInfo info_;
};

}  // namespace tomofield::testing
