#include "exchange/portal_alignment_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "base/log.h"
#include "io/images/mrc.h"
#include "io/json.h"
#include "output/alignment_files.h"
#include "output/output_paths.h"

namespace tomofield::exchange {

namespace fs = std::filesystem;
namespace {

using nlohmann::json;

json vector_json(const std::array<double, 3>& values) {
  return {{"x", values[0]}, {"y", values[1]}, {"z", values[2]}};
}

// A volume in the frame of the aligned view, in Å: Z points up, whatever the order of axes is.
struct Place {
  std::array<double, 3> size_A, middle_A;
};

Place place_of(const io::MrcHeader& header, VolumeAxes axes, double thickness_A) {
  const std::array<std::int64_t, 3> voxels{header.nx, header.ny, header.nz};
  Place place{};
  for (std::size_t a = 0; a < 3; ++a) {
    place.size_A[a] = static_cast<double>(voxels[a]) * header.voxel_size_A[a];
    place.middle_A[a] = header.origin_A[a] + place.size_A[a] / 2;
  }
  if (axes == VolumeAxes::kXzy) {  // rows count down from the upper face
    std::swap(place.size_A[1], place.size_A[2]);
    std::swap(place.middle_A[1], place.middle_A[2]);
    place.middle_A[2] = thickness_A - place.middle_A[2];
  }
  return place;
}

// Offsets count from the tilt axis, as that of the volume does.
json section_json(const tilt_series::PlannedSeries& series, std::size_t index,
                  const SpecimenOptions& specimen, double axis_from_middle_px) {
  const tilt_series::View& view = series.views()[index];
  const geometry::RawFromAligned m = output::map_from_axis(series, index, axis_from_middle_px);
  return {{"z_index", view.section},
          {"tilt_angle", specimen.hand * view.tilt_deg},
          {"volume_x_rotation", specimen.hand * view.x_tilt_deg},
          {"in_plane_rotation", {{m.m11, m.m12}, {m.m21, m.m22}}},
          {"x_offset", m.shift_x_px},
          {"y_offset", m.shift_y_px}};
}

bool has_local_motion(const tilt_series::PlannedSeries& series) {
  const auto is_local = [](const tilt_series::PlannedView& view) { return view.local.has_value(); };
  return std::ranges::any_of(series.plan().views, is_local);
}

}  // namespace

void write_portal_alignment(const tilt_series::PlannedSeries& series,
                            const options::ReconstructOptions& options, const fs::path& volume) {
  const SpecimenOptions& specimen = options.specimen;
  const double pixel_A = series.pixel_size_A() / series.bin_factor();
  const output::TiltAxis axis = output::tilt_axis(series, specimen);
  const Place place =
      place_of(io::MrcReader(volume).header(), options.volume.axes, axis.thickness_px * pixel_A);
  const std::array<double, 3> middle_of_series_A{
      static_cast<double>(series.aligned_width()) / 2 * series.pixel_size_A() +
          axis.from_middle_px * pixel_A,
      static_cast<double>(series.aligned_height()) / 2 * series.pixel_size_A(),
      axis.height_px * pixel_A};
  std::array<double, 3> offset_A{};
  for (std::size_t a = 0; a < 3; ++a) offset_A[a] = place.middle_A[a] - middle_of_series_A[a];
  const fs::path path = output::output_paths(options.run.output).portal_alignment;
  const bool is_local = has_local_motion(series);
  if (is_local) {
    base::log_warning(fmt::format(
        "'{}' has no place for local alignments, which this tomogram has: its shifts are those "
        "without them",
        path.string()));
  }
  json sections = json::array();
  for (std::size_t i = 0; i < series.views().size(); ++i)
    sections.push_back(section_json(series, i, specimen, axis.from_middle_px));
  const json record{
      {"alignment_type", is_local ? "LOCAL" : "GLOBAL"},
      {"format", "TOMOFIELD"},
      {"is_portal_standard", !is_local},
      {"affine_transformation_matrix", {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}},
      {"tilt_offset", 0},
      {"x_rotation_offset", 0},
      {"volume_offset", vector_json(offset_A)},
      {"volume_dimension", vector_json(place.size_A)},
      {"per_section_alignment_parameters", sections}};
  io::write_json(path, record);
}

}  // namespace tomofield::exchange
