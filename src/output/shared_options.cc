#include "output/shared_options.h"

#include "io/saving/scratch_memory.h"

namespace tomofield::output {
namespace {

io::MrcMode mrc_mode(VoxelType type) {
  switch (type) {
    case VoxelType::kFloat32:
      return io::MrcMode::kFloat32;
    case VoxelType::kFloat16:
      return io::MrcMode::kFloat16;
    case VoxelType::kInt16:
      return io::MrcMode::kInt16;
  }
  return io::MrcMode::kFloat32;
}

}  // namespace

tilt_series::TiltSeriesOptions series_options(const SeriesFiles& files, const Options& options) {
  tilt_series::TiltSeriesOptions series;
  series.stack = files.stack;
  series.tlt = files.tlt;
  series.xf = files.xf;
  series.xtilt = files.xtilt;
  series.aln = files.aln;
  series.mdoc = files.mdoc;
  series.mask = files.mask;
  series.fiducials = files.fiducials;
  series.tilt_offset_deg = options.tilt_offset_deg;
  series.x_axis_tilt_deg = options.x_axis_tilt_deg;
  if (files.even && files.odd) series.halves = {*files.even, *files.odd};
  series.exclude = options.exclude;
  series.tilt_axis_deg = options.tilt_axis_deg;
  series.starts_raw = options.align == Alignment::kFull;
  series.ignore = options.ignore;
  series.bin = options.bin;
  series.angpix = options.angpix;
  series.pixel_size_A = options.pixel_size_A;
  series.contrast = options.contrast;
  series.take_log = options.take_log;
  series.log_base = options.log_base;
  series.background = options.black_level.value_or(0.0);
  series.bead_diameter_nm = options.bead_diameter_nm;
  series.remove_fixed_pattern = options.remove_fixed_pattern;
  series.resample = options.engine == Engine::kSlab;
  series.scratch_dir = io::scratch_directory(options.output);
  return series;
}

measurement::SpecimenOptions specimen_options(const Options& options) {
  measurement::SpecimenOptions specimen{.thickness = options.thickness,
                                        .roi = {},
                                        .hand = options.hand,
                                        .axis_x = options.axis_x,
                                        .axis_z = options.axis_z,
                                        .shift_z = options.shift_z,
                                        .with_margin = options.with_margin};
  if (const auto& roi = options.roi) specimen.roi = {roi->x0, roi->y0, roi->x1, roi->y1};
  return specimen;
}

ModelInfo model_info(const measurement::Measurement& series, Contrast contrast) {
  ModelInfo info;
  info.geometry = series.geometry;
  info.roi = series.roi;
  info.x_tilt_deg = series.x_tilt_deg;
  info.pixel_size_A = series.pixel_size_A;
  info.density_unit = series.unit;
  info.is_dark = contrast == Contrast::kDark;
  return info;
}

VolumeOptions volume_options(const Options& options) {
  return {.box = {},
          .mode = mrc_mode(options.voxel_type),
          .axes = options.axes,
          .invert = options.invert,
          .zarr = options.zarr};
}

}  // namespace tomofield::output
