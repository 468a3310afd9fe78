#include "microscope/exposure.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <map>
#include <numeric>
#include <string_view>
#include <utility>

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

// Says which two views have the same exposure before them; nothing if all differ that have one.
std::string equal_ones(const std::vector<std::optional<double>>& before, std::string_view views) {
  std::map<double, std::size_t> view_of;
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (!before[i]) continue;
    const auto [first, is_new] = view_of.emplace(*before[i], i);
    if (!is_new)
      return fmt::format("{} {} and {} have the same dose before them, {:g}", views,
                         first->second + 1, i + 1, *before[i]);
  }
  return "";
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

using Sections = std::vector<std::size_t>;  // counted from 1
using Dose = std::optional<double> io::MdocSection::*;

// Returns the sections that do not have a dose. SerialEM writes 0 for an ExposureDose that it does
// not know; 0 before a section is a dose.
Sections sections_without(const io::Mdoc& mdoc, Dose dose) {
  Sections without;
  for (std::size_t i = 0; i < mdoc.sections.size(); ++i) {
    const std::optional<double>& value = mdoc.sections[i].*dose;
    const bool may_be_zero = dose == &io::MdocSection::prior_dose;
    if (!value || *value < 0.0 || (*value == 0.0 && !may_be_zero)) without.push_back(i + 1);
  }
  return without;
}

bool has_dose(const io::Mdoc& mdoc, Dose dose) {
  return std::ranges::any_of(mdoc.sections, [&](const io::MdocSection& section) {
    return (section.*dose).value_or(0.0) > 0.0;
  });
}

std::string names_of(const Sections& sections) {
  constexpr std::size_t kMostNames = 8;
  const bool are_many = sections.size() > kMostNames;
  return fmt::format("section{} {}{}", sections.size() == 1 ? "" : "s",
                     fmt::join(sections.begin(),
                               sections.begin() + static_cast<std::ptrdiff_t>(
                                                      std::min(sections.size(), kMostNames)),
                               ", "),
                     are_many ? " …" : "");
}

// Tells whether exposures are those of the sections whose PriorRecordDose is known, within half a
// view. A file in which it is 0 everywhere does not know it.
bool agree(const std::vector<Exposure>& exposures, const io::Mdoc& mdoc) {
  if (!has_dose(mdoc, &io::MdocSection::prior_dose)) return true;
  for (std::size_t i = 0; i < exposures.size(); ++i) {
    const std::optional<double>& prior = mdoc.sections[i].prior_dose;
    if (prior && std::fabs(*prior - exposures[i].before) > exposures[i].of_view / 2) return false;
  }
  return true;
}

// Returns how DateTime or ExposureDose contradict the PriorRecordDose of all sections, or nothing.
// Doses between two sections may be more than that of the first, since views are repeated.
std::string contradiction_of(const io::Mdoc& mdoc, bool has_doses) {
  const io::AcquisitionOrder by_time = io::acquisition_order(mdoc);
  if (by_time.is_stated && contradicts_prior_doses(by_time.sections, mdoc))
    return "PriorRecordDose falls while DateTime rises";
  if (!has_doses) return "";
  Sections order(mdoc.sections.size());
  std::iota(order.begin(), order.end(), 0);
  const auto prior = [&](std::size_t i) { return *mdoc.sections[i].prior_dose; };
  std::ranges::sort(order, {}, prior);
  for (std::size_t i = 1; i < order.size(); ++i) {
    const double rise = prior(order[i]) - prior(order[i - 1]);
    if (rise < *mdoc.sections[order[i - 1]].dose / 2)
      return "PriorRecordDose rises by less than ExposureDose";
  }
  return "";
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

std::vector<Exposure> exposures_in_order(std::span<const std::size_t> order,
                                         std::span<const double> doses) {
  std::vector<Exposure> exposures(order.size());
  double sum = 0.0;
  for (const std::size_t i : order) {
    exposures[i] = {sum, doses[i]};
    sum += doses[i];
  }
  return exposures;
}

bool contradicts_prior_doses(std::span<const std::size_t> order, const io::Mdoc& mdoc) {
  double last = 0.0;
  for (const std::size_t i : order) {
    const std::optional<double>& prior = mdoc.sections[i].prior_dose;
    if (prior && *prior < last) return true;
    last = prior.value_or(last);
  }
  return false;
}

StatedExposures exposures_of(const io::Mdoc& mdoc) {
  const Sections no_prior = sections_without(mdoc, &io::MdocSection::prior_dose);
  const Sections no_dose = sections_without(mdoc, &io::MdocSection::dose);
  std::vector<std::optional<double>> before;
  for (const io::MdocSection& section : mdoc.sections) before.push_back(section.prior_dose);
  if (auto exposures = exposures_from(before)) {
    if (std::string fault = contradiction_of(mdoc, no_dose.empty()); !fault.empty())
      return {std::nullopt, std::move(fault)};
    if (no_dose.size() == mdoc.sections.size())
      if (std::string fault = equal_ones(before, "sections"); !fault.empty())
        return {std::nullopt, std::move(fault)};
    for (std::size_t i = 0; no_dose.empty() && i < exposures->size(); ++i)
      (*exposures)[i].of_view = *mdoc.sections[i].dose;
    return {std::move(exposures), {}};
  }
  const bool has_some_prior = no_prior.size() < mdoc.sections.size();
  if (no_dose.empty()) {
    const io::AcquisitionOrder order = io::acquisition_order(mdoc);
    if (!order.fault_of_times.empty())
      return {std::nullopt, fmt::format("{}, and nothing else tells the order of recording",
                                        order.fault_of_times)};
    std::vector<double> doses;
    for (const io::MdocSection& section : mdoc.sections) doses.push_back(*section.dose);
    std::vector<Exposure> exposures = exposures_in_order(order.sections, doses);
    if (!has_some_prior || agree(exposures, mdoc)) return {std::move(exposures), {}};
    if (order.is_stated)
      return {std::nullopt, "ExposureDose and DateTime contradict PriorRecordDose"};
    return {std::nullopt,
            fmt::format("PriorRecordDose is missing in {}, and nothing else tells the "
                        "order of recording",
                        names_of(no_prior))};
  }
  if (has_some_prior && !no_prior.empty() && has_dose(mdoc, &io::MdocSection::prior_dose))
    return {std::nullopt, fmt::format("PriorRecordDose is missing in {}", names_of(no_prior))};
  if (has_dose(mdoc, &io::MdocSection::dose))
    return {std::nullopt, fmt::format("ExposureDose is missing or 0 in {}", names_of(no_dose))};
  for (const io::MdocSection& section : mdoc.sections)
    if (section.frame_doses_line > 0)
      return {std::nullopt, fmt::format("line {} states doses of frames (FrameDosesAndNumber), and "
                                        "no section one of its view",
                                        section.frame_doses_line)};
  return {};
}

StatedExposures exposures_of(const io::ViewTable& table) {
  std::vector<std::optional<double>> before, used;
  for (const io::ListedView& view : table.views) {
    before.push_back(view.dose_before);
    used.push_back(view.is_used ? view.dose_before : std::nullopt);
  }
  auto exposures = exposures_from(before);
  if (!exposures) return {};
  if (std::string fault = equal_ones(used, "rows"); !fault.empty())
    return {std::nullopt, std::move(fault)};
  return {std::move(exposures)};
}

StatedExposures exposures_of(const io::TiltTable& table) {
  const auto none = std::ranges::find(table.doses, 0.0);
  if (std::ranges::all_of(table.doses, [](double dose) { return dose == 0.0; })) return {};
  if (none == table.doses.end()) return {exposures_in_order(table.order, table.doses)};
  return {std::nullopt,
          fmt::format("row {} has a dose of 0", std::distance(table.doses.begin(), none) + 1)};
}

}  // namespace tomofield::microscope
