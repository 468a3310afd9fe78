#include "reconstruct/warnings.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

namespace tomofield::reconstruction {
namespace {

// The limits are from the series of docs/verdict.md. Beside each stand the values of correct series
// and of those with the fault.

// Rise of the brightness with the rays' length: 0.1 … 11 where the contrast is right, and the
// opposite where it is wrong. Views that are normalised one by one may have no rise.
constexpr double kLeastFall = 1.0, kLeastCorrelation = 0.5;

// Tilt order: at least 0.89 for the right angles, and at most 0.71 for shuffled ones. Of views that
// are displaced by several per cent of their width it is less clear: 0.5 to 0.85.
constexpr double kLeastOrder = 0.75, kLeastOrderIfDisplaced = 0.6;

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

// Part of the sections that are empty: up to 0.34 where the thickness is right, and from 0.46 on
// where it is twice that.
constexpr double kMostEmpty = 0.4;

// Correlation of the residual between neighbours, along the axis where it is smaller: up to 0.4 for
// views as recorded or interpolated once, and 0.8 for denoised ones. A residual of much more than
// the noise is structure, which is smooth in any case.
constexpr double kMostCorrelated = 0.6;

// Error of the defocus, as a part of it and in standard errors: docs/results/ctf.md.
constexpr double kLeastDefocusError = 0.01, kDefocusErrors = 4.0;
// The error of the defocus's slope is 0 for the right hand and −2 for the wrong one, which the
// density follows in part.
constexpr double kHandError = -0.5;
// Views that are small against their fringes tell the slope badly, and their standard errors are
// then too small: a yardstick of 256 pixels of 5 Å gives -2.1 ± 0.4 for the right hand.
constexpr double kMostHandError = 0.25;

// Beside the sections that are not empty, the suggested thickness has this part of them.
constexpr double kRoom = 0.2;

std::optional<Warning> wrong_contrast(const ViewAgreement& views, Contrast given) {
  const PathEffect& path = views.path;
  if (path.rise > -kLeastFall || path.correlation > -kLeastCorrelation) return std::nullopt;
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
  const double least = is_displaced_along_axis(views) ? kLeastOrderIfDisplaced : kLeastOrder;
  if (!views.tilt_order || *views.tilt_order >= least) return std::nullopt;
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

std::optional<Warning> thickness_warning(const Verdict& verdict, const GivenInput& input) {
  const SectionProfile& sections = verdict.sections;
  const double most_at_faces =
      verdict.residual > kResidualOfBadFit ? kMostAtFacesOfBadFit : kMostAtFaces;
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

std::optional<Warning> wrong_defocus(const DefocusCheck& check) {
  if (std::abs(check.error) < kLeastDefocusError ||
      std::abs(check.error) < kDefocusErrors * check.standard_error)
    return std::nullopt;
  return Warning{"defocus",
                 fmt::format("the residuals have rings as if the defocus were {:.1f} % {} than "
                             "given (rings explain {:.2f} % of them): check --ctf or --defocus, "
                             "the pixel size and the voltage",
                             100 * std::abs(check.error), check.error > 0 ? "larger" : "smaller",
                             100 * check.rings)};
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

}  // namespace

std::vector<Warning> find_warnings(const Verdict& verdict, const GivenInput& input) {
  std::vector<Warning> warnings;
  const auto add = [&](std::optional<Warning> found) {
    if (found) warnings.push_back(std::move(*found));
  };
  if (verdict.views) {
    add(wrong_contrast(*verdict.views, input.contrast));
    const bool is_contrast_wrong = !warnings.empty();
    add(shuffled(*verdict.views));
    if (!is_contrast_wrong) add(misaligned(*verdict.views, input.alignment));
  }
  if (warnings.empty()) {
    if (verdict.defocus) add(wrong_defocus(*verdict.defocus));
    if (verdict.defocus) add(wrong_defocus_hand(*verdict.defocus));
    add(thickness_warning(verdict, input));
    if (verdict.views) add(correlated_noise(verdict, input.bin_factor));
  }
  return warnings;
}

}  // namespace tomofield::reconstruction
