#include "io/tables/unknown_entries.h"

#include <fmt/format.h>
#include <strings.h>

#include <algorithm>
#include <array>
#include <cctype>

#include "io/tables/text_lines.h"

namespace tomofield::io {
namespace {

constexpr std::size_t kNumOfTomograms = 2;  // columns that a table of tomograms alone has
constexpr std::array<std::string_view, 69> kKnown{
    "rlnTomoDefocusSlope", "rlnMtfFileName",
    // relion_star.cc reads these columns of the tables of views, of tomograms and of optics.
    "rlnMicrographName", "rlnMicrographNameEven", "rlnMicrographNameOdd",
    "rlnTomoNominalStageTiltAngle", "rlnTomoNominalTiltAxisAngle", "rlnTomoXTilt", "rlnTomoYTilt",
    "rlnTomoZRot", "rlnTomoXShiftAngst", "rlnTomoYShiftAngst", "rlnMicrographPreExposure",
    "rlnDefocusU", "rlnDefocusV", "rlnDefocusAngle", "rlnPhaseShift", "rlnVoltage",
    "rlnSphericalAberration", "rlnAmplitudeContrast", "rlnMicrographPixelSize",
    "rlnTomoTiltSeriesPixelSize", "rlnDetectorPixelSize", "rlnMagnification", "rlnTomoName",
    "rlnTomoTiltSeriesStarFile", "rlnTomoHand", "rlnTomoSizeX", "rlnTomoSizeY", "rlnTomoSizeZ",
    "rlnTomoDeformationCoefficients", "rlnMagMat00", "rlnMagMat01", "rlnMagMat10", "rlnMagMat11",
    "rlnBeamTiltX", "rlnBeamTiltY", "rlnOddZernike", "rlnEvenZernike",
    // These columns hold names, targets, qualities of fits, and other results.
    "rlnMicrographMovieName", "rlnMicrographMetadata", "rlnMicrographOriginalPixelSize",
    "rlnMicrographBinning", "rlnMicrographGainName", "rlnMicrographDefectFile", "rlnMicrographId",
    "rlnTomoTiltMovieFrameCount", "rlnTomoTiltMovieIndex", "rlnTomoFrameCount",
    "rlnTomoNominalDefocus", "rlnAccumMotionTotal", "rlnAccumMotionEarly", "rlnAccumMotionLate",
    "rlnCtfPowerSpectrum", "rlnCtfImage", "rlnCtfAstigmatism", "rlnCtfFigureOfMerit",
    "rlnCtfMaxResolution", "rlnCtfIceRingDensity", "rlnFinalResolution", "rlnOpticsGroup",
    "rlnOpticsGroupName", "rlnEtomoDirectiveFile", "rlnTomoTomogramBinning",
    "rlnTomoReconstructedTomogram", "rlnTomoReconstructedTomogramHalf1",
    "rlnTomoReconstructedTomogramHalf2", "rlnTomoReconstructedTomogramDenoised",
    "rlnTomoDenoisedTomogram"};

}  // namespace

std::span<const std::string_view> known_tomogram_columns() { return kKnown; }

std::span<const std::string_view> known_view_columns() {
  return std::span<const std::string_view>(kKnown).subspan(kNumOfTomograms);
}

bool is_not_zero(const std::string& text) {
  return text != "None" && std::ranges::any_of(text, [](unsigned char c) {
           return (c >= '1' && c <= '9') || (std::isalpha(c) != 0 && c != 'e' && c != 'E');
         });
}

std::vector<std::string> unknown_columns(const StarTable& table,
                                         std::span<const std::string_view> known) {
  std::vector<std::string> unknown;
  for (const std::string& column : table.columns()) {
    const bool is_known = std::ranges::any_of(known, [&](std::string_view name) {
      return name.size() == column.size() &&
             strncasecmp(name.data(), column.c_str(), name.size()) == 0;
    });
    bool is_stated = false;
    for (std::size_t i = 0; i < table.num_rows() && !is_known; ++i)
      is_stated |= is_not_zero(*table.find(i, column));
    if (is_stated) unknown.push_back("_" + column);
  }
  return unknown;
}

std::optional<std::string> remark_on_unknown(std::span<const std::string> entries) {
  constexpr std::size_t kMostNames = 8;
  if (entries.empty()) return std::nullopt;
  std::vector<std::string> names;
  for (const std::string& entry : entries.first(std::min(entries.size(), kMostNames)))
    names.push_back(quote(entry));
  if (entries.size() > kMostNames) names.emplace_back("…");
  return fmt::format("this program does not know {}, which {} no effect", fmt::join(names, ", "),
                     entries.size() == 1 ? "has" : "have");
}

}  // namespace tomofield::io
