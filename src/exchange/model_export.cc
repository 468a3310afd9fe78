#include "exchange/model_export.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "base/check.h"
#include "base/log.h"
#include "exchange/particles/particle_list.h"
#include "io/saving/output_files.h"
#include "io/saving/output_set.h"
#include "io/tables/star_file.h"
#include "output/box_bounds.h"
#include "output/volume.h"
#include "output/volume_frame.h"
#include "tomofield/error.h"

namespace tomofield::exchange {
namespace {

namespace fs = std::filesystem;
using field::OrientedBox;

// Throws Error for angles of 90° and more, and for those that are no numbers.
void require_possible(const Levelling& level) {
  constexpr double kLargest_deg = 90.0;
  if (std::abs(level.pitch_deg) < kLargest_deg && std::abs(level.x_tilt_deg) < kLargest_deg) return;
  throw Error(fmt::format("--level {},{} has an angle that is not below 90°", level.pitch_deg,
                          level.x_tilt_deg));
}

void warn_of_margin(const output::Model& model, const OrientedBox& box) {
  const output::BoxBounds bounds(box), region = output::region_bounds(model);
  const auto axis = bounds.axis_beyond(region, 0.5 * box.voxel_px);
  if (!axis) return;
  base::log_warning(fmt::format(
      "the box reaches outside the region that was reconstructed: its {} runs from {:.6g} to "
      "{:.6g} px, the region's from {:.6g} to {:.6g}; what lies there is a guess or nothing",
      "xyz"[*axis], bounds.low[*axis], bounds.high[*axis], region.low[*axis], region.high[*axis]));
}

}  // namespace

std::vector<io::OutputLock> claim_export(const ExportFiles& files, const std::string& advice) {
  return io::claim_outputs({files.output}, [&] {
    base::require_no_faults(output::faults_of(files.volume));
    std::vector<fs::path> results{files.output}, inputs;
    if (!files.model.empty()) inputs.push_back(files.model);
    if (!files.particles.empty()) {
      if (files.volume.zarr || files.volume.axes != VolumeAxes::kXyz)
        throw Error(
            "--particles writes an MRC stack in the order of xyz: leave --zarr and --axes out");
      io::require_star_text(files.output.string());
      results.push_back(particle_star(files.output));
      inputs.push_back(files.particles);
    }
    io::check_output_files(results, inputs, files.overwrite, advice);
    io::require_volume_name(files.output);
    if (files.volume.zarr) output::check_zarr(files.output, inputs, files.overwrite, advice);
  });
}

namespace {

// Sizes beyond these are read as none.
void require_voxel_size(double voxel_A) {
  if (base::is_plausible_pixel_size(voxel_A)) return;
  throw Error(
      fmt::format("voxels of {:.3g} Å cannot be written: give --bin or --voxel-size so that "
                  "they have from {} to {} Å",
                  voxel_A, base::kPixelSizes_A.low(), base::kPixelSizes_A.high()));
}

}  // namespace

OrientedBox box_in_field(const output::Model& model, const ExportPlace& place) {
  const Levelling level = place.level.value_or(Levelling{});
  require_possible(level);
  if (!place.box) return output::region_box(model, place.voxel_px, level);
  const OrientedBox box = output::VolumeFrame(model, level).to_field(*place.box);
  warn_of_margin(model, box);
  return box;
}

void export_volume(const output::Model& model, const OrientedBox& box, const ExportFiles& files) {
  require_voxel_size(box.voxel_px * model.pixel_size_A);
  io::OutputSet results;
  output::write_volume(model, files.volume, files.output, {.box = box});
  results.commit();
}

CutParticles export_particles(const output::Model& model, const ParticleBoxes& boxes,
                              const std::string& tomogram, const ExportFiles& files) {
  constexpr std::int64_t kLargestSide = 4096;
  if (boxes.size < 1 || boxes.size > kLargestSide)
    throw Error("--particles needs the side of their boxes in voxels: --box N, from 1 to 4096");
  require_possible(boxes.levelling);
  require_voxel_size(boxes.voxel_px * model.pixel_size_A);
  ParticleList list = read_particle_list(files.particles, files.model, model, tomogram);
  const std::size_t count = list.particles.size();
  io::OutputSet results;
  const std::size_t num_beyond =
      write_particles(model, std::move(list), boxes, files.volume, files.output);
  results.commit();
  return {count, num_beyond};
}

}  // namespace tomofield::exchange
