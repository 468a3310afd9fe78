#include "evaluate/artefacts.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "evaluate/speckle.h"
#include "evaluate/volume_pair.h"
#include "io/images/mrc.h"
#include "output/model_file.h"
#include "output/output_paths.h"
#include "output/volume.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

namespace fs = std::filesystem;

// Returns true if a volume has the voxels that reconstruct writes of a model: one a pixel of the
// region, along the axes of the field.
bool fits(const output::ModelOutline& model, const base::Shape3& shape) {
  const field::OrientedBox box = output::region_box(model, 1.0);
  return box.is_aligned() && box.size == std::array{shape.nx, shape.ny, shape.nz};
}

// Returns true if a volume was turned, or lies elsewhere than the region of a model, as its header
// says.
bool lies_elsewhere(const output::ModelOutline& model, const fs::path& path) {
  const io::MrcReader volume(path);
  if (is_turned(volume)) return true;
  const auto place = place_A(volume);
  return place && !lies_at(*place, model.roi, model.pixel_size_A);
}

void require_fit(const output::ModelOutline& model, const fs::path& path, const base::Shape3& shape,
                 const fs::path& volume) {
  if (fits(model, shape) && lies_elsewhere(model, volume))
    throw Error(
        fmt::format("'{}' was turned, or is another part than the region of the model '{}', as its "
                    "header says: give the volume that was written with the model",
                    volume.string(), path.string()));
  if (fits(model, shape)) return;
  const auto size = output::region_box(model, 1.0).size;
  throw Error(fmt::format(
      "the volume has {} × {} × {} voxels, but '{}' is a model of {} × {} × {}{}: give the model "
      "that was written with the volume, and a volume with the axes X, Y, Z",
      shape.nx, shape.ny, shape.nz, path.string(), size[0], size[1], size[2],
      model.x_tilt_deg == 0.0 ? "" : ", turned by an x-axis tilt"));
}

// Returns the outline of the model beside a volume if it belongs to the volume.
std::optional<output::ModelOutline> model_beside(const fs::path& volume,
                                                 const base::Shape3& shape) {
  const fs::path path = output::output_paths(volume).model;
  if (!fs::exists(path)) return std::nullopt;
  try {
    output::ModelOutline model = output::load_outline(path);
    if (fits(model, shape) && !lies_elsewhere(model, volume)) return model;
  } catch (const Error&) {  // another program's file; nobody asked for it
  }
  return std::nullopt;
}

}  // namespace

Artefacts find_artefacts(const base::Volume& volume, const fs::path& path,
                         const std::optional<fs::path>& model) {
  Artefacts found{.speckle = speckle(volume), .faces = {}};
  std::optional<output::ModelOutline> outline;
  if (model) {
    outline = output::load_outline(*model);
    require_fit(*outline, *model, volume.shape, path);
  } else {
    outline = model_beside(path, volume.shape);
  }
  if (outline) found.faces = face_jump(volume, LeafFaces(outline->tree, outline->roi));
  return found;
}

}  // namespace tomofield::evaluate
