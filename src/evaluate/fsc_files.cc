#include "evaluate/fsc_files.h"

#include <fmt/format.h>

#include <cmath>

#include "base/log.h"
#include "base/memory.h"
#include "evaluate/volume_pair.h"
#include "io/mrc.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

// Counts both volumes, the weights and the complex transform, in single precision.
constexpr std::size_t kBytesOfVoxel = 20;

void check_memory(const FscFiles& files) {
  const io::MrcReader file(files.second);
  const base::Box box = files.box.value_or(whole_box(file));
  if (!lies_within(box, whole_box(file))) return;  // read_pair() reports this error
  base::require_memory(kBytesOfVoxel * box.shape().voxels(), "the shell correlation",
                       "restrict it with --box, or bin both volumes");
}

base::Volume read_mask(const std::filesystem::path& path, const std::filesystem::path& second,
                       const base::Box& box) {
  const io::MrcReader mask(path), volume(second);
  if (whole_box(mask) != whole_box(volume)) {
    const auto size = [](const io::MrcReader& f) {
      return fmt::format("{} × {} × {}", f.header().nx, f.header().ny, f.header().nz);
    };
    throw Error(fmt::format("the mask '{}' has {} voxels and '{}' {}: give a mask of that size",
                            path.string(), size(mask), second.string(), size(volume)));
  }
  return read_box(mask, box);
}

nlohmann::json crossing_json(const std::optional<double>& crossing) {
  return crossing ? nlohmann::json(*crossing) : nlohmann::json();
}

nlohmann::json curve_json(const Fsc& fsc, const FscCurve& curve) {
  return {{"resolution_at_0.5_A", crossing_json(crossing_A(fsc.frequency_per_A, curve, 0.5))},
          {"resolution_at_0.143_A", crossing_json(crossing_A(fsc.frequency_per_A, curve, 0.143))},
          {"correlation", curve.correlation},
          {"voxels", curve.voxels}};
}

}  // namespace

Fsc correlate_files(const FscFiles& files) {
  check_memory(files);
  VolumePair pair = read_pair(files.first, files.second, files.box);
  if (!(pair.second.voxel_size_A > 0.0)) {
    base::log_warning(fmt::format("'{}' has no voxel size: resolutions are in voxels, not in Å",
                                  files.second.string()));
    pair.second.voxel_size_A = 1.0;
  }
  const base::Volume weights =
      files.mask ? read_mask(*files.mask, files.second, pair.box) : edge_window(pair.second.shape);
  return fourier_shell_correlation(pair.first, pair.second, weights, files.tilts);
}

nlohmann::json fsc_json(const Fsc& fsc, const FscFiles& files) {
  nlohmann::json json = {{"first", files.first.string()},
                         {"second", files.second.string()},
                         {"frequency_per_A", fsc.frequency_per_A},
                         {"all", curve_json(fsc, fsc.all)}};
  json["mask"] = files.mask ? nlohmann::json(files.mask->string()) : nlohmann::json();
  if (files.box) {
    json["box_first"] = files.box->begin;
    json["box_last"] = files.box->end;
  }
  if (files.tilts) {
    json["tilt_range_deg"] = {files.tilts->low_deg, files.tilts->high_deg};
    json["measured"] = curve_json(fsc, *fsc.measured);
    json["missing"] = curve_json(fsc, *fsc.missing);
  }
  return json;
}

std::string fsc_csv(const Fsc& fsc) {
  const bool has_wedge = fsc.measured.has_value();
  std::string text = "frequency_per_A,resolution_A,fsc,voxels";
  text += has_wedge ? ",fsc_measured,voxels_measured,fsc_missing,voxels_missing\n" : "\n";
  for (std::size_t s = 0; s < fsc.frequency_per_A.size(); ++s) {
    const auto columns = [s](const FscCurve& curve) {
      const double value = curve.correlation[s];
      return fmt::format(",{},{}", std::isnan(value) ? "" : fmt::format("{:.6f}", value),
                         curve.voxels[s]);
    };
    text += fmt::format("{:.8g},{:.6g}", fsc.frequency_per_A[s], 1.0 / fsc.frequency_per_A[s]);
    text += columns(fsc.all);
    if (has_wedge) text += columns(*fsc.measured) + columns(*fsc.missing);
    text += "\n";
  }
  return text;
}

}  // namespace tomofield::evaluate
