#include "exchange/particles/particle_stack.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/trace.h"
#include "io/images/mrc.h"
#include "io/saving/atomic_file.h"
#include "io/tables/text_lines.h"
#include "output/box_bounds.h"
#include "output/model_input_record.h"
#include "output/sample_model.h"
#include "output/sampling_time.h"
#include "output/volume.h"
#include "tomofield/error.h"

namespace tomofield::exchange {
namespace {

namespace fs = std::filesystem;
using field::OrientedBox;

/// Returns the box of a particle in the field.
OrientedBox box_of(const Particle& particle, const output::VolumeFrame& frame,
                   const ParticleBoxes& boxes) {
  OrientedBox box{.size = {boxes.size, boxes.size, boxes.size},
                  .voxel_px = boxes.voxel_px,
                  .field_from_box = particle.volume_from_box};
  // The middle of voxel int(size / 2) lies half a voxel above the middle of an even box.
  const double middle = static_cast<double>(boxes.size / 2) + 0.5;
  const field::Point offset = box.position({middle, middle, middle});
  for (std::size_t a = 0; a < 3; ++a) box.centre_px[a] = particle.place_px[a] - offset[a];
  return frame.to_field(box);
}

void require_some_inside(const output::Model& model, std::span<const OrientedBox> boxes) {
  const output::BoxBounds field = output::field_bounds(model);
  const auto is_apart = [&](const OrientedBox& box) {
    return output::BoxBounds(box).axis_apart(field).has_value();
  };
  if (!std::ranges::all_of(boxes, is_apart)) return;
  const auto& [x, y, z] = boxes.front().centre_px;
  throw Error(fmt::format(
      "none of the {} particles lies in the model: the first one is at x {:.6g}, y {:.6g}, z "
      "{:.6g} px, and the model ends at {:.6g}, {:.6g}, {:.6g} px. Are the particles of this "
      "tomogram?",
      boxes.size(), x, y, z, field.high[0], field.high[1], field.high[2]));
}

io::MrcSpec stack_of(std::int64_t size, std::size_t count, const output::ModelInfo& model,
                     double voxel_px, const VolumeOptions& options) {
  io::MrcSpec spec;
  spec.nx = spec.ny = spec.sections_a_volume = size;
  spec.nz = size * static_cast<std::int64_t>(count);
  spec.mode = output::mrc_mode(options.voxel_type);
  spec.voxel_size_A.fill(voxel_px * model.pixel_size_A);
  spec.labels = output::volume_labels(model, "particles of a density field");
  return spec;
}

// Describes the subvolumes in a row of the optics. Columns of the images that they replace count
// for them, too: RELION's pixels are those of the tilt series, binned.
void describe_images(const ParticleBoxes& boxes, double voxel_A, std::size_t row,
                     io::StarTable& optics) {
  optics.set(row, "rlnImagePixelSize", fmt::format("{:.6f}", voxel_A));
  optics.set(row, "rlnImageSize", std::to_string(boxes.size));
  optics.set(row, "rlnImageDimensionality", "3");
  if (optics.has_column("rlnTomoSubtomogramBinning")) {
    const auto pixel = optics.find(row, "rlnTomoTiltSeriesPixelSize");
    const auto pixel_A = pixel ? io::parse_number(*pixel) : std::nullopt;
    optics.set(row, "rlnTomoSubtomogramBinning",
               pixel_A && *pixel_A > 0 ? fmt::format("{:.6f}", voxel_A / *pixel_A) : "None");
  }
  if (optics.has_column("rlnCtfDataAreCtfPremultiplied"))
    optics.set(row, "rlnCtfDataAreCtfPremultiplied", "0");
}

void write_list(ParticleList list, const ParticleBoxes& boxes, double voxel_A,
                const fs::path& stack) {
  for (std::size_t row = 0; row < list.table.num_rows(); ++row)
    list.table.set(row, "rlnImageName", fmt::format("{:06}@{}", row + 1, stack.string()));
  list.table.remove("rlnCtfImage");
  for (std::size_t row = 0; row < list.optics.num_rows(); ++row)
    describe_images(boxes, voxel_A, row, list.optics);
  io::StarTable general("general", {"rlnTomoSubTomosAre2DStacks"});
  general.add_row({"0"});
  std::string text = io::star_file_text(general);
  if (list.optics.num_rows() > 0) text += io::star_file_text(list.optics);
  io::write_text_file(particle_star(stack), text + io::star_file_text(list.table));
}

}  // namespace

fs::path particle_star(const fs::path& stack) { return fs::path(stack).replace_extension(".star"); }

std::size_t write_particles(const output::Model& model, ParticleList list,
                            const ParticleBoxes& boxes, const VolumeOptions& options,
                            const fs::path& stack) {
  const base::TraceSpan span("write particles");
  const output::VolumeFrame frame(model, boxes.levelling);
  std::vector<OrientedBox> places;
  for (const Particle& particle : list.particles) places.push_back(box_of(particle, frame, boxes));
  require_some_inside(model, places);
  io::MrcSpec spec = stack_of(boxes.size, places.size(), model, boxes.voxel_px, options);
  double scale = options.invert ? -model.output_scale() : model.output_scale();
  if (options.voxel_type == VoxelType::kInt16) {
    { const io::MrcWriter probe(stack, spec); }  // refuses before the pass, not after it
    scale *= output::int16_factor(scale * static_cast<double>(output::largest_density(model)),
                                  spec.labels.front());
  }
  io::MrcWriter file(stack, spec);
  output::announce_sampling(model, places);
  const output::BoxBounds region = output::region_bounds(model);
  std::size_t num_cut = 0;
  for (std::size_t p = 0; p < places.size(); ++p) {
    std::vector<float> values = output::sample_box(model, places[p]);
    for (float& value : values) value = static_cast<float>(scale) * value + 0.0f;  // no −0
    file.write_sections(static_cast<std::int64_t>(p) * boxes.size, values);
    if (output::BoxBounds(places[p]).axis_beyond(region, 0.5 * boxes.voxel_px)) ++num_cut;
  }
  file.close();
  write_list(std::move(list), boxes, boxes.voxel_px * model.pixel_size_A, stack);
  return num_cut;
}

}  // namespace tomofield::exchange
