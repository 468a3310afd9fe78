#include "microscope/exposure.h"

#include <algorithm>
#include <cmath>

namespace tomofield::microscope {
namespace {

// Returns how much a lower voltage shortens the exposure that the specimen bears.
double voltage_factor(double voltage_kV) {
  constexpr double kLow_kV = 120, kLow = 0.45, kMiddle_kV = 200, kMiddle = 0.8, kHigh_kV = 300;
  const double kV = std::clamp(voltage_kV, kLow_kV, kHigh_kV);
  if (kV < kMiddle_kV) return std::lerp(kLow, kMiddle, (kV - kLow_kV) / (kMiddle_kV - kLow_kV));
  return std::lerp(kMiddle, 1.0, (kV - kMiddle_kV) / (kHigh_kV - kMiddle_kV));
}

// Returns the smallest difference between two of the values that is not 0, or 0.
double smallest_step(std::vector<double> values) {
  std::ranges::sort(values);
  double step = 0.0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    const double difference = values[i] - values[i - 1];
    if (difference > 0.0 && (step == 0.0 || difference < step)) step = difference;
  }
  return step;
}

// Returns the exposures from those before each view, or nothing if one is missing or negative, or
// if all are 0.
std::optional<std::vector<Exposure>> exposures_from(
    const std::vector<std::optional<double>>& before) {
  std::vector<double> values;
  values.reserve(before.size());
  for (const std::optional<double>& value : before) {
    if (!value || *value < 0.0) return std::nullopt;
    values.push_back(*value);
  }
  if (std::ranges::all_of(values, [](double value) { return value == 0.0; })) return std::nullopt;
  const double of_view = smallest_step(values);
  std::vector<Exposure> exposures;
  exposures.reserve(values.size());
  for (const double value : values) exposures.push_back({value, of_view});
  return exposures;
}

}  // namespace

double critical_exposure(double k, double voltage_kV) {
  return voltage_factor(voltage_kV) * (0.245 * std::pow(k, -1.665) + 2.81);
}

double signal_after(double exposure, double k, double voltage_kV) {
  return std::exp(-exposure / (2.0 * critical_exposure(k, voltage_kV)));
}

std::vector<Exposure> exposures_in_order(std::span<const std::size_t> order, double of_view) {
  std::vector<Exposure> exposures(order.size());
  for (std::size_t i = 0; i < order.size(); ++i)
    exposures[order[i]] = {static_cast<double>(i) * of_view, of_view};
  return exposures;
}

std::optional<std::vector<Exposure>> exposures_of(const io::Mdoc& mdoc) {
  std::vector<std::optional<double>> before;
  bool has_own = true;
  for (const io::MdocSection& section : mdoc.sections) {
    before.push_back(section.prior_dose);
    has_own = has_own && section.dose.value_or(0.0) > 0.0;
  }
  std::optional<std::vector<Exposure>> exposures = exposures_from(before);
  if (!has_own) return exposures;
  if (exposures) {
    for (std::size_t i = 0; i < exposures->size(); ++i)
      (*exposures)[i].of_view = *mdoc.sections[i].dose;
    return exposures;
  }
  exposures.emplace(mdoc.sections.size());
  double sum = 0.0;
  for (const std::size_t i : io::acquisition_order(mdoc)) {
    (*exposures)[i] = {sum, *mdoc.sections[i].dose};
    sum += *mdoc.sections[i].dose;
  }
  return exposures;
}

std::optional<std::vector<Exposure>> exposures_of(const io::ViewTable& table) {
  std::vector<std::optional<double>> before;
  for (const io::ListedView& view : table.views) before.push_back(view.dose_before);
  return exposures_from(before);
}

}  // namespace tomofield::microscope
