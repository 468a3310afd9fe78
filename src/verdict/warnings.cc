#include "verdict/warnings.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/statistics.h"

namespace tomofield::verdict {
namespace {

// The limits are from the series of docs/results/archive/verdict.md. Beside each stand the values
// of correct series and of those with the fault.

// Rise of the brightness with the rays' length: 0.1 … 11 where the contrast is right, and the
// opposite where it is wrong. Views that are normalised one by one may have no rise. A cell that
// ends in the field of view tells less, but a wrong contrast then leaves a residual; defocus takes
// the brightness of large areas away, and with it both.
constexpr double kLeastFall = 1.0, kLeastCorrelation = 0.5, kLeastCorrelationOfBadFit = 0.3;
constexpr double kResidualOfWrongContrast = 1.2;

// Tilt order: at least 0.73 for the right angles, also of views that are displaced by several per
// cent of their width, and at most 0.59 for shuffled ones.
constexpr double kLeastOrder = 0.65;

// Correlation of a view with its prediction, over that of the views that are predicted well: 0.3
// and more, whatever else is wrong, and 0.00 ± 0.02 if the view shows nothing of the specimen. The
// second number is what those must have so that this can be said.
constexpr double kLeastOfView = 0.12, kLeastOfGoodViews = 0.06;
constexpr std::ptrdiff_t kFewestEmptyViews = 2;

// How much less profiles along the y axis agree than along the best direction, over how much more
// these agree than usual: at most 0.13 for the right axis, and 0.35 to 1.1 for one that is 30° or
// more off. A rod along the axis has its profile across the axis in common, but leaves no residual.
// Where noise hides the residual, profiles along a wrong axis have next to nothing in common.
constexpr double kMostAxisDeficit = 0.25, kResidualOfWrongAxis = 1.5;
constexpr double kLeastAxisContrast = 0.1, kLeastAxisContrastOfNoise = 0.15;
constexpr double kLeastVerticalOfNoise = 0.3;

// Usual displacement in pixels: up to 0.56, along the axis 0.33, for aligned views of which some
// are off by a pixel; from 1.17 or 0.65 on for unaligned ones.
// In larger views than those, as many blocks of pixels count: a raw stack is off by some per cent
// of its width, and a good alignment of unbinned views by a pixel or more.
constexpr double kMostDisplacement = 1.0, kMostDisplacementY = 0.5, kSideOfSmallViews = 512;

// Correlation of the displacements with the shifts that were given: 0.72 to 0.96 for stacks that
// were aligned before, and up to 0.74 for shifts of another stack of the same size.
constexpr double kSameShifts = 0.75;

// Variation at the faces: up to 0.5 where the thickness is right, and from 1.8 on where it is half
// of that, together with a residual of more than 1.1. What a fit cannot explain for other reasons
// gathers at the faces as well: two real series, with residuals of 1.6 and of 60, have up to 2.6.
// Simulated ones of half the thickness that have such residuals have 3.2 and more.
constexpr double kMostAtFaces = 1.5, kLeastResidual = 1.08;
constexpr double kMostAtFacesOfBadFit = 3.0, kResidualOfBadFit = 1.5;
// The same if the direction of the axis is sure, so that it is no reason of the residual.
constexpr double kMostAtFacesOfSureAxis = 1.4, kSureAxisContrast = 0.2, kSureAxisDeficit = 0.1;

// Part of the sections that are empty: up to 0.34 where the thickness is right, and from 0.46 on
// where it is twice that.
constexpr double kMostEmpty = 0.4;

// Correlation of the residual between neighbours, along the axis where it is smaller: up to 0.4 for
// views as recorded or interpolated once, and 0.8 for denoised ones. A residual of much more than
// the noise is structure, which is smooth in any case.
constexpr double kMostCorrelated = 0.6;

// Error of the defocus, as a part of it and in standard errors: docs/results/ctf.md.
constexpr double kLeastDefocusError = 0.01, kDefocusErrors = 4.0;
// Rings explain up to 0.3 % of the residuals of right series whose errors seem to be 9 to 63 %.
// Farther off, the change of a view is no longer in proportion to that of the defocus.
constexpr double kLeastRings = 0.005, kMostDefocusError = 0.5;
// Correlation of the views' spectra with the rings of a defocus, and part of it that rings of the
// given defocus have: 0.7 and all of it for a right series of 14 rings. Where there are fewer than
// three rings, a right series has 0.44 and none of it.
constexpr double kFewestRings = 5.0, kLeastRingAgreement = 0.3, kLeastOfRings = 0.5;
constexpr double kLeastRingErrors = 5.0;
// The error of the defocus's slope is 0 for the right hand and −2 for the wrong one, which the
// density follows in part.
constexpr double kHandError = -0.5;
// Views that are small against their fringes tell the slope badly, and their standard errors are
// then too small: a yardstick of 256 pixels of 5 Å gives -2.1 ± 0.4 for the right hand.
constexpr double kMostHandError = 0.25;

// Residual that no noise explains: 0.7 to 1.6 for right series, and 1.4 and more with some faults.
// A residual between these is a fault if it is alike over four pixels.
constexpr double kMostResidual = 3.0, kMostStructuredResidual = 1.35, kMostFarCorrelation = 0.06;

// Speckle: up to 2.7 % in specimens with points as small as a voxel, which are predicted as well as
// the rest; 0.55 % in exosomes whose residual is 1.55, where it is noise.
constexpr double kMostSpeckle = 0.003, kResidualOfSpeckle = 1.4;

// Error of held-out views over the residual: up to 1.12 for right series.
constexpr double kMostOverfit = 1.6;

// Beside the sections that are not empty, the suggested thickness has this part of them.
constexpr double kRoom = 0.2;

// Standard deviation of a section in units of the contrast of the views: 0.01 and more where there
// is a specimen.
constexpr double kLeastDeviation = 1e-6;

std::optional<Warning> empty_tomogram(const std::vector<double>& section_deviation) {
  if (section_deviation.empty() || std::ranges::max(section_deviation) > kLeastDeviation)
    return std::nullopt;
  return Warning{"empty",
                 "the tomogram is empty, because every voxel has the same density: look for views "
                 "whose grey levels differ from the rest, and check --contrast and --black-level"};
}

// Settings that keep the fit from explaining the views look like faults of the input.
std::optional<Warning> extreme_settings(const Verdict& verdict,
                                        const std::vector<std::string>& settings) {
  if (settings.empty() || verdict.residual < kMostResidual) return std::nullopt;
  return Warning{"settings",
                 fmt::format("the tomogram does not explain the views: it leaves {:.3g} times the "
                             "variance of their noise. Settings that were given prevent it: leave "
                             "out {}, or give values nearer to the usual ones",
                             verdict.residual, fmt::join(settings, ", "))};
}

std::optional<Warning> wrong_contrast(const Verdict& verdict, Contrast given) {
  const PathEffect& path = verdict.views->path;
  const bool is_sure = verdict.residual > kResidualOfWrongContrast && !verdict.defocus;
  const double least = is_sure ? kLeastCorrelationOfBadFit : kLeastCorrelation;
  if (path.rise > -kLeastFall || path.correlation > -least) return std::nullopt;
  const bool is_dark = given == Contrast::kDark;
  return Warning{"contrast",
                 fmt::format("the contrast seems wrong, because views count as thinner where their "
                             "rays through the volume are longer: give --contrast {} if dense "
                             "parts are {} in the stack",
                             is_dark ? "bright" : "dark", is_dark ? "bright" : "dark")};
}

// Returns a limit for small views as it is for these views.
double scaled(double limit, const ViewAgreement& views) {
  return limit * std::max(1.0, views.side_px / kSideOfSmallViews);
}

// Only wrong alignment displaces views along the tilt axis.
bool is_displaced_along_axis(const ViewAgreement& views) {
  return views.usual_displacement_y_px() > scaled(kMostDisplacementY, views);
}

std::optional<Warning> shuffled(const ViewAgreement& views) {
  if (!views.tilt_order || *views.tilt_order >= kLeastOrder) return std::nullopt;
  return Warning{"tilt-order",
                 "the angles seem to belong to other views, because neighbours in tilt are no more "
                 "alike than any views: give one angle a section in the stack's order (--tlt)"};
}

// Returns where an aligned view would lie if its stack had been aligned before.
std::array<double, 2> shift_of(const geometry::RawFromAligned& m) {
  const double determinant = m.m11 * m.m22 - m.m12 * m.m21;
  return {-(m.m22 * m.shift_x_px - m.m12 * m.shift_y_px) / determinant,
          -(m.m11 * m.shift_y_px - m.m21 * m.shift_x_px) / determinant};
}

// Returns the correlation of the views' displacements with the shifts that the alignment applied.
double correlation_with_shifts(const ViewAgreement& views,
                               const std::vector<geometry::RawFromAligned>& alignment) {
  const auto count = static_cast<double>(views.views.size());
  double both = 0, shifts = 0, displacements = 0;
  for (const std::size_t axis : {0, 1}) {
    double mean_shift = 0, mean_displacement = 0;
    const auto shift = [&](std::size_t i) {
      return shift_of(alignment[static_cast<std::size_t>(views.views[i])])[axis];
    };
    for (std::size_t i = 0; i < views.views.size(); ++i) {
      mean_shift += shift(i) / count;
      mean_displacement += views.displacement_px[i][axis] / count;
    }
    for (std::size_t i = 0; i < views.views.size(); ++i) {
      const double a = shift(i) - mean_shift;
      const double b = views.displacement_px[i][axis] - mean_displacement;
      both += a * b;
      shifts += a * a;
      displacements += b * b;
    }
  }
  return shifts > 0 && displacements > 0 ? both / std::sqrt(shifts * displacements) : 0.0;
}

std::optional<Warning> misaligned(const ViewAgreement& views,
                                  const std::vector<geometry::RawFromAligned>& alignment) {
  const double any = views.usual_displacement_px();
  // Shuffled angles displace views across the axis.
  if (!is_displaced_along_axis(views) &&
      (shuffled(views) || any <= scaled(kMostDisplacement, views)))
    return std::nullopt;
  const std::string off =
      fmt::format("views lie up to {:.1f} pixels from where the tomogram predicts them", any);
  if (std::ranges::all_of(alignment, &geometry::RawFromAligned::is_identity))
    return Warning{"unaligned",
                   fmt::format("the stack seems not to be aligned, because {}: give its transforms "
                               "(--xf or --aln), or an aligned stack",
                               off)};
  if (correlation_with_shifts(views, alignment) > kSameShifts)
    return Warning{
        "aligned-twice",
        fmt::format("the stack seems to be aligned already, because {}, in the direction "
                    "of the shifts that were given: leave --xf or --aln out, or give the "
                    "raw stack",
                    off)};
  return Warning{"misaligned",
                 fmt::format("the alignment seems not to belong to the stack, because {}: check "
                             "that --xf or --aln has a line for each section, in its order, and "
                             "that the stack is not aligned already",
                             off)};
}

std::optional<Warning> empty_views(const ViewAgreement& views,
                                   const std::vector<double>& tilt_deg) {
  std::vector<float> all(views.correlation.begin(), views.correlation.end());
  if (all.empty()) return std::nullopt;
  const double of_good = base::percentile(all, 90);
  if (of_good < kLeastOfGoodViews) return std::nullopt;
  std::vector<std::string> tilts;
  for (std::size_t i = 0; i < views.views.size(); ++i)
    if (views.correlation[i] < kLeastOfView * of_good)
      tilts.push_back(fmt::format("{:.1f}°", tilt_deg[static_cast<std::size_t>(views.views[i])]));
  if (std::ssize(tilts) < kFewestEmptyViews) return std::nullopt;
  return Warning{"views",
                 fmt::format("{} of {} views that were compared show nothing of what the others "
                             "show (at {}): look at the stack, and leave dark or damaged sections "
                             "out with --exclude",
                             tilts.size(), views.views.size(), fmt::join(tilts, ", "))};
}

// Returns how much less profiles along the y axis agree than along the best direction.
double axis_deficit(const AxisCheck& axis) {
  return (axis.best - axis.vertical) / (axis.best - axis.usual);
}

std::optional<Warning> wrong_axis(const Verdict& verdict, Alignment aligned_before) {
  if (!verdict.views->axis) return std::nullopt;
  const AxisCheck& axis = *verdict.views->axis;
  const double contrast = axis.best - axis.usual;
  const bool leaves_residual = verdict.residual > kResidualOfWrongAxis &&
                               contrast > kLeastAxisContrast &&
                               axis_deficit(axis) > kMostAxisDeficit;
  const bool is_clear_in_noise =
      contrast > kLeastAxisContrastOfNoise && axis.vertical < kLeastVerticalOfNoise * axis.best;
  if (!leaves_residual && !is_clear_in_noise) return std::nullopt;
  return Warning{
      "tilt-axis",
      fmt::format("the tilt axis seems not to be vertical in the aligned views, because "
                  "what they have in common lies along a direction about {:.0f}° from "
                  "the y axis: give {}",
                  axis.direction_deg,
                  aligned_before == Alignment::kFull
                      ? "the direction from which --align full begins (--tilt-axis)"
                      : "the transforms with the rotation of the axis (--xf or --aln), or "
                        "find it with --align full")};
}

bool is_axis_sure(const Verdict& verdict) {
  if (!verdict.views || !verdict.views->axis) return false;
  const AxisCheck& axis = *verdict.views->axis;
  return axis.best - axis.usual > kSureAxisContrast && axis_deficit(axis) < kSureAxisDeficit;
}

std::optional<Warning> thickness_warning(const Verdict& verdict, const GivenInput& input) {
  const SectionProfile& sections = verdict.sections;
  const double of_bad_fit = is_axis_sure(verdict) ? kMostAtFacesOfSureAxis : kMostAtFacesOfBadFit;
  const double most_at_faces = verdict.residual > kResidualOfBadFit ? of_bad_fit : kMostAtFaces;
  if (sections.faces > most_at_faces && verdict.residual > kLeastResidual) {
    return Warning{"thin",
                   fmt::format("the thickness seems too small, because the density varies {:.1f} "
                               "times as much at the faces of the volume as in its middle: try "
                               "--thickness {:.0f}, and check that the tilt axis is vertical in "
                               "the aligned views, which would look the same if it were not",
                               sections.faces, 1.5 * input.thickness * input.bin_factor)};
  }
  if (sections.faces > kMostAtFaces || sections.empty_part <= kMostEmpty) return std::nullopt;
  const double filled = (1 - sections.empty_part) * (1 + kRoom) * input.thickness;
  return Warning{"thick",
                 fmt::format("{:.0f} % of the volume's sections are almost empty: "
                             "--thickness {:.0f} would take less time and memory",
                             100 * sections.empty_part, std::ceil(filled) * input.bin_factor)};
}

std::optional<Warning> correlated_noise(const Verdict& verdict, double bin_factor) {
  const auto [x, y] = verdict.views->residual_correlation;
  if (verdict.residual > kResidualOfBadFit || std::min(x, y) <= kMostCorrelated)
    return std::nullopt;
  return Warning{
      "correlated-noise",
      fmt::format("the noise of neighbouring pixels is alike (correlation {:.2f}), as in "
                  "views that were smoothed or enlarged, and the fit may take it for "
                  "structure: give views as recorded, or --bin {:g}",
                  std::min(x, y), 2 * bin_factor)};
}

std::string defocus_advice(double error) {
  return fmt::format("as if the defocus were {:.1f} % {} than given", 100 * std::abs(error),
                     error > 0 ? "larger" : "smaller");
}

// Judges the spectra of the views alone, which tell a defocus that is far off.
std::optional<Warning> wrong_rings(const RingCheck& check) {
  if (check.rings < kFewestRings || check.agreement < kLeastRingAgreement ||
      check.given > kLeastOfRings * check.agreement ||
      check.agreement - check.given < kLeastRingErrors * check.standard_error)
    return std::nullopt;
  return Warning{"defocus",
                 fmt::format("the spectra of the views have rings {} (correlation {:.2f}, and "
                             "{:.2f} with the given one): check --ctf or --defocus, the pixel size "
                             "and the voltage",
                             defocus_advice(check.factor - 1), check.agreement, check.given)};
}

std::optional<Warning> wrong_defocus(const DefocusCheck& check) {
  if (check.spectra)
    if (const auto rings = wrong_rings(*check.spectra)) return rings;
  if (std::abs(check.error) < kLeastDefocusError || std::abs(check.error) > kMostDefocusError ||
      check.rings < kLeastRings || std::abs(check.error) < kDefocusErrors * check.standard_error)
    return std::nullopt;
  return Warning{"defocus",
                 fmt::format("the residuals have rings {} (rings explain {:.2f} % of them): check "
                             "--ctf or --defocus, the pixel size and the voltage",
                             defocus_advice(check.error), 100 * check.rings)};
}

std::optional<Warning> wrong_defocus_hand(const DefocusCheck& check) {
  if (!check.slope || check.slope->error > kHandError ||
      check.slope->standard_error > kMostHandError ||
      -check.slope->error < kDefocusErrors * check.slope->standard_error)
    return std::nullopt;
  return Warning{"defocus-hand",
                 fmt::format("the defocus across tilted views changes as if the other side were "
                             "farther from focus ({:.1f} ± {:.1f} times as given): give "
                             "--defocus-hand with the other sign",
                             1 + check.slope->error, check.slope->standard_error)};
}

// Says what is left to be done about the alignment of views that are not explained.
const char* advice_on_alignment(Alignment aligned_before) {
  switch (aligned_before) {
    case Alignment::kOff:
      return "the alignment, first of all the direction of the tilt axis (--align refine shows "
             "what "
             "it would gain)";
    case Alignment::kRefine:
      return "the alignment that was refined, first of all the direction of the tilt axis (--align "
             "full begins with the views as recorded)";
    case Alignment::kFull:
      return "the direction of the tilt axis, with which --align full began (--tilt-axis gives "
             "another one)";
  }
  return "";
}

std::optional<Warning> unexplained(const Verdict& verdict, Alignment aligned_before) {
  double far = 0.0;
  if (verdict.views)
    far = std::min(verdict.views->far_correlation[0], verdict.views->far_correlation[1]);
  if (verdict.residual < kMostResidual &&
      (verdict.residual < kMostStructuredResidual || far < kMostFarCorrelation))
    return std::nullopt;
  return Warning{
      "residual",
      fmt::format(
          "the tomogram does not explain the views: it leaves {:.3g} times the variance of "
          "their noise. Check the tilt angles and {}, and look for views that are damaged or "
          "differ from the rest",
          verdict.residual, advice_on_alignment(aligned_before))};
}

// Names a view that is explained far worse than the others, or returns an empty text.
std::string foreign_view(const GivenInput& input) {
  constexpr double kTimes = 5, kLeastOfForeign = 3;
  if (input.residual.empty()) return "";
  const auto worst = std::ranges::max_element(input.residual);
  const double usual = base::median(input.residual);
  if (*worst < kLeastOfForeign || *worst < kTimes * usual) return "";
  return fmt::format(
      "the view at {:.1f}° leaves {:.3g} times the variance of its noise, and the others {:.2g}: "
      "look whether it is damaged or of another specimen (--exclude leaves it out); else ",
      input.tilt_deg[static_cast<std::size_t>(worst - input.residual.begin())], *worst, usual);
}

std::optional<Warning> speckled(const Verdict& verdict, const GivenInput& input) {
  const auto& speckle = verdict.artefacts.speckle;
  if (!speckle || *speckle < kMostSpeckle || verdict.residual < kResidualOfSpeckle)
    return std::nullopt;
  return Warning{"speckle",
                 fmt::format("{:.2f} % of the voxels stick out from all their neighbours, and the "
                             "views are not explained by it, so that it is probably noise: {}give "
                             "a stronger --denoise, or --tv-penalty smooth",
                             100 * *speckle, foreign_view(input))};
}

std::optional<Warning> overfitted(const Verdict& verdict) {
  if (!verdict.held_out || verdict.held_out->median < kMostOverfit * verdict.residual ||
      verdict.held_out->median < 1.0)
    return std::nullopt;
  return Warning{"overfit",
                 fmt::format("views that were not fitted are predicted with {:.1f} times the error "
                             "of those that were: the tomogram has structure that only its own "
                             "views want; give a stronger --denoise",
                             verdict.held_out->median / verdict.residual)};
}

// Finds faults of the input that the views show, in the order in which they hide each other.
std::vector<Warning> faults_of_views(const Verdict& verdict, const GivenInput& input) {
  const ViewAgreement& views = *verdict.views;
  if (const auto empty = empty_views(views, input.tilt_deg)) return {*empty};
  std::vector<Warning> found;
  if (const auto contrast = wrong_contrast(verdict, input.contrast)) found.push_back(*contrast);
  const bool is_contrast_wrong = !found.empty();
  if (const auto order = shuffled(views)) found.push_back(*order);
  if (!is_contrast_wrong)
    if (const auto alignment = misaligned(views, input.alignment)) found.push_back(*alignment);
  if (!found.empty()) return found;
  if (const auto axis = wrong_axis(verdict, input.aligned_before)) found.push_back(*axis);
  return found;
}

}  // namespace

std::vector<Warning> find_warnings(const Verdict& verdict, const GivenInput& input) {
  std::vector<Warning> warnings;
  if (const auto empty = empty_tomogram(verdict.artefacts.section_deviation)) return {*empty};
  if (const auto extreme = extreme_settings(verdict, input.extreme_settings)) return {*extreme};
  if (verdict.views) warnings = faults_of_views(verdict, input);
  if (!warnings.empty()) return warnings;
  const auto add = [&](std::optional<Warning> found) {
    if (found) warnings.push_back(std::move(*found));
  };
  if (verdict.defocus) add(wrong_defocus(*verdict.defocus));
  if (verdict.defocus) add(wrong_defocus_hand(*verdict.defocus));
  add(thickness_warning(verdict, input));
  if (verdict.views) add(correlated_noise(verdict, input.bin_factor));
  if (!warnings.empty()) return warnings;
  add(unexplained(verdict, input.aligned_before));
  add(speckled(verdict, input));
  add(overfitted(verdict));
  return warnings;
}

}  // namespace tomofield::verdict
