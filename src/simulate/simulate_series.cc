#include "simulate/simulate_series.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/plausible.h"
#include "base/statistics.h"
#include "geometry/raw_from_aligned.h"
#include "io/images/mrc.h"
#include "io/saving/atomic_file.h"
#include "io/saving/output_files.h"
#include "io/saving/output_folder.h"
#include "io/saving/output_lock.h"
#include "io/saving/output_set.h"
#include "io/saving/output_target.h"
#include "io/tables/ctf_table.h"
#include "io/tables/write_alignment.h"
#include "simulate/cryo/electron_counts.h"
#include "simulate/cryo/particle_files.h"
#include "simulate/imaging.h"
#include "simulate/noise.h"
#include "simulate/phantom.h"
#include "simulate/phantom_record.h"
#include "simulate/project_phantom.h"
#include "simulate/rasterize.h"
#include "tomofield/error.h"

namespace tomofield::simulate {
namespace {

namespace fs = std::filesystem;

// Random streams from here on make the noise: one for each row of each view.
constexpr std::uint64_t kNoiseStream = std::uint64_t{1} << 32;
constexpr std::int64_t kTruthBatchVoxels = std::int64_t{1} << 22;

fs::path reference_of(const std::string& kind, const fs::path& directory) {
  return directory / fmt::format("particle_{}.mrc", kind);
}

struct OutputFiles {
  /// `kinds` are those of the specimen's particles.
  OutputFiles(const fs::path& directory, std::span<const ParticleKind> kinds)
      : series(directory / "tilt_series.mrc"),
        clean(directory / "clean.mrc"),
        truth(directory / "truth.mrc"),
        angles(directory / "tilt_series.tlt"),
        recorded_angles(directory / "tilt_series.rawtlt"),
        transforms(directory / "tilt_series.xf"),
        ctf(directory / "tilt_series_ctf.txt"),
        defocus(directory / "tilt_series.defocus"),
        mdoc(directory / "tilt_series.mdoc"),
        even(directory / "tilt_series_even.mrc"),
        odd(directory / "tilt_series_odd.mrc"),
        membranes(directory / "membranes.mrc"),
        particles(directory / "particles.star"),
        record(directory / "phantom.json") {
    for (const ParticleKind& kind : kinds) references.push_back(reference_of(kind.name, directory));
    for (const std::string& kind : listed_kinds(particles)) {
      const fs::path old = reference_of(kind, directory);
      if (fs::is_regular_file(old) && std::ranges::find(references, old) == references.end())
        old_references.push_back(old);
    }
  }
  fs::path series, clean, truth, angles, recorded_angles, transforms, ctf, defocus, mdoc, even, odd,
      membranes, particles, record;

  std::vector<fs::path> references;  // densities of the kinds of particles
  /// Densities of particles that the list of an earlier series has. This one does not write them.
  std::vector<fs::path> old_references;

  std::vector<fs::path> all() const {
    std::vector<fs::path> files{series,  clean, truth, angles, recorded_angles, transforms, ctf,
                                defocus, mdoc,  even,  odd,    membranes,       particles,  record};
    files.insert(files.end(), references.begin(), references.end());
    files.insert(files.end(), old_references.begin(), old_references.end());
    return files;
  }
};

// Checks that the files can be written, and locks the series, which every simulation writes.
std::vector<io::OutputLock> claim_files(const OutputFiles& files, const SimulationOptions& options,
                                        bool overwrite) {
  std::vector<fs::path> inputs;
  for (const ParticleFile& file : options.particle_files) inputs.push_back(file.path);
  return io::claim_outputs({files.series}, [&] {
    io::check_output_files(files.all(), inputs, overwrite,
                           "give another directory, or --overwrite to replace it");
  });
}

// Throws Error before the work unless the disk has room for the volume and the stacks.
void require_disk(const fs::path& directory, const CellOptions& cell, std::size_t num_views,
                  bool write_truth) {
  constexpr std::int64_t kStacks = 2, kBytes = 4;  // with noise and without, as floats
  const base::CheckedSize plane = base::CheckedSize(cell.size_px) * cell.size_px * kBytes;
  const base::CheckedSize bytes =
      plane * kStacks * num_views + plane * (write_truth ? cell.thickness_px : 0);
  io::require_room(directory, directory / "truth.mrc", bytes.find().value_or(INT64_MAX));
}

io::MrcSpec mrc_spec(std::int64_t nx, std::int64_t ny, std::int64_t nz, bool is_volume,
                     const SimulationOptions& options, const char* what) {
  const double size = options.voxel_size_A;
  return {.nx = nx,
          .ny = ny,
          .nz = nz,
          .voxel_size_A = {size, size, size},
          .is_volume = is_volume,
          .labels = {fmt::format("tomofield simulate: {}, seed {}", what, options.cell.seed)}};
}

SimulationSummary::Truth write_truth(const fs::path& path, const Phantom& phantom,
                                     const SimulationOptions& options) {
  const base::Shape3& shape = phantom.shape;
  io::MrcWriter writer(path,
                       mrc_spec(shape.nx, shape.ny, shape.nz, true, options, "truth of a cell"));
  const std::int64_t section_voxels = shape.nx * shape.ny;
  const std::int64_t batch = std::clamp<std::int64_t>(kTruthBatchVoxels / section_voxels, 1, 64);
  std::vector<float> sections(static_cast<std::size_t>(section_voxels * batch));
  SimulationSummary::Truth truth{.min = 1e30, .max = -1e30, .mean = 0.0};
  for (std::int64_t first = 0; first < shape.nz; first += batch) {
    const std::int64_t count = std::min(batch, shape.nz - first);
    const auto used = std::span(sections).first(static_cast<std::size_t>(section_voxels * count));
    rasterize_sections(phantom, first, count, used);
    for (std::int64_t z = 0; z < count; ++z) {
      const auto section = used.subspan(static_cast<std::size_t>(z * section_voxels),
                                        static_cast<std::size_t>(section_voxels));
      writer.write_section(first + z, section);
      const auto [low, high] = std::minmax_element(section.begin(), section.end());
      truth.min = std::min(truth.min, static_cast<double>(*low));
      truth.max = std::max(truth.max, static_cast<double>(*high));
      double sum = 0.0;
      for (const float value : section) sum += static_cast<double>(value);
      truth.mean += sum / static_cast<double>(section_voxels * shape.nz);
    }
  }
  writer.close();
  return truth;
}

ViewFrame frame_of(const SimulatedView& view, const Phantom& phantom) {
  return {.width = phantom.shape.nx,
          .height = phantom.shape.ny,
          .tilt_deg = view.tilt_deg,
          .raw_from_aligned = view.raw_from_aligned,
          .warp = view.warp};
}

// Returns the standard deviation of the noise in data units (SimulationOptions::noise). It is that
// of the series without local motion, which may move an edge of the specimen into the view.
double noise_sigma(const Phantom& phantom, const std::vector<SimulatedView>& views, double noise) {
  const auto nearest = std::min_element(views.begin(), views.end(),
                                        [](const SimulatedView& a, const SimulatedView& b) {
                                          return std::abs(a.tilt_deg) < std::abs(b.tilt_deg);
                                        });
  std::vector<float> image(static_cast<std::size_t>(phantom.shape.nx * phantom.shape.ny));
  ViewFrame frame = frame_of(*nearest, phantom);
  frame.warp.reset();
  project_view(phantom, frame, image);
  const double low = base::percentile(image, 0.5);
  return noise * (base::percentile(std::move(image), 99.5) - low);
}

// Computes what a view shows before the detector.
void compute_view(const Phantom& phantom, const SimulatedView& view,
                  const SimulationOptions& options, std::vector<float>& image) {
  const ViewFrame frame = frame_of(view, phantom);
  if (options.imaging.filters())
    image_view(phantom, frame, options.imaging, view.defocus, view.exposure.at_middle(),
               options.voxel_size_A, image);
  else
    project_view(phantom, frame, image);
}

void add_noise(std::vector<float>& image, const Phantom& phantom, const SimulationOptions& options,
               std::optional<double> sigma, std::uint64_t first_stream) {
  const std::int64_t width = phantom.shape.nx;
  const std::uint64_t seed = options.cell.seed;
  if (!sigma)
    draw_counts(image, width, seed, first_stream);
  else if (options.noise_blur_px > 0.0)
    add_blurred_noise(image, width, *sigma, options.noise_blur_px, seed, first_stream);
  else
    add_gaussian_noise(image, width, *sigma, seed, first_stream);
}

// Writes both stacks, one view at a time.
void write_views(const OutputFiles& files, const Phantom& phantom,
                 const std::vector<SimulatedView>& views, const SimulationOptions& options,
                 std::optional<double> sigma) {
  const base::Shape3& shape = phantom.shape;
  const auto num_views = static_cast<std::int64_t>(views.size());
  io::MrcWriter clean(files.clean,
                      mrc_spec(shape.nx, shape.ny, num_views, false, options, "noise-free views"));
  io::MrcWriter series(files.series,
                       mrc_spec(shape.nx, shape.ny, num_views, false, options, "tilt series"));
  const Detector detector(options);
  std::vector<float> image(static_cast<std::size_t>(shape.nx * shape.ny));
  for (std::int64_t i = 0; i < num_views; ++i) {
    const SimulatedView& view = views[static_cast<std::size_t>(i)];
    compute_view(phantom, view, options, image);
    detector.expose(image, view.gain);
    clean.write_section(i, image);
    add_noise(image, phantom, options, sigma,
              kNoiseStream + static_cast<std::uint64_t>(i * shape.ny));
    series.write_section(i, image);
  }
  clean.close();
  series.close();
}

io::MrcWriter stack_writer(const fs::path& path, std::size_t num_views,
                           const SimulationOptions& options, const char* what) {
  return {path, mrc_spec(options.cell.size_px, options.cell.size_px,
                         static_cast<std::int64_t>(num_views), false, options, what)};
}

ElectronCounts electron_counts(const SimulationOptions& options) {
  return ElectronCounts(
      {.dose_per_A2 = options.imaging.dose_per_tilt,
       .pixel_size_A = options.voxel_size_A,
       .thickness_A = static_cast<double>(options.cell.thickness_px) * options.voxel_size_A,
       .voltage_kV = options.imaging.optics.voltage_kV});
}

// Writes the counts of all frames, those of the even and odd ones, and the expected counts.
void write_counts(const OutputFiles& files, const Phantom& phantom,
                  const std::vector<SimulatedView>& views, const SimulationOptions& options) {
  const std::size_t n = views.size();
  io::MrcWriter clean = stack_writer(files.clean, n, options, "expected electrons");
  io::MrcWriter series = stack_writer(files.series, n, options, "electrons");
  io::MrcWriter even = stack_writer(files.even, n, options, "electrons of the even frames");
  io::MrcWriter odd = stack_writer(files.odd, n, options, "electrons of the odd frames");
  const ElectronCounts counts = electron_counts(options);
  const std::int64_t size = options.cell.size_px;
  std::vector<float> image(static_cast<std::size_t>(size * size));
  for (std::size_t i = 0; i < n; ++i) {
    compute_view(phantom, views[i], options, image);
    counts.expose(image, views[i].tilt_deg, views[i].gain);
    const auto section = static_cast<std::int64_t>(i);
    const FrameCounts frames =
        draw_frames(image, size, options.cell.seed,
                    kNoiseStream + 2 * static_cast<std::uint64_t>(section * size));
    clean.write_section(section, image);
    series.write_section(section, frames.all);
    even.write_section(section, frames.even);
    odd.write_section(section, frames.odd);
  }
  for (io::MrcWriter* writer : {&clean, &series, &even, &odd}) writer->close();
}

void write_volume(const fs::path& path, const base::Volume& volume, io::MrcMode mode,
                  const SimulationOptions& options, const char* what) {
  const base::Shape3& shape = volume.shape;
  io::MrcSpec spec = mrc_spec(shape.nx, shape.ny, shape.nz, true, options, what);
  spec.mode = mode;
  io::MrcWriter writer(path, spec);
  writer.write_sections(0, volume.data);
  writer.close();
}

// Writes what a user can look for in the specimen.
void write_labels(const OutputFiles& files, const CryoSpecimen& specimen,
                  const SimulationOptions& options) {
  const double voxel_A = options.voxel_size_A;
  io::write_text_file(files.particles, particle_list(specimen));
  write_volume(files.membranes, membrane_label(specimen, voxel_A), io::MrcMode::kInt8, options,
               "membranes");
  for (std::size_t i = 0; i < specimen.kinds.size(); ++i)
    write_volume(files.references[i], reference_density(specimen.kinds[i], voxel_A),
                 io::MrcMode::kFloat32, options, "density of a particle");
}

void write_angles(const fs::path& path, const std::vector<SimulatedView>& views) {
  std::vector<double> angles_deg;
  for (const SimulatedView& view : views) angles_deg.push_back(view.tilt_deg);
  io::write_number_column(path, angles_deg);
}

// Writes the angles with the errors that the microscope made.
void write_recorded_angles(const fs::path& path, const std::vector<SimulatedView>& views) {
  std::vector<double> angles_deg;
  for (const SimulatedView& view : views) angles_deg.push_back(view.tilt_deg + view.tilt_error_deg);
  io::write_number_column(path, angles_deg);
}

// Writes the transforms that undo the misalignment except for local motion.
void write_transforms(const fs::path& path, const std::vector<SimulatedView>& views) {
  std::vector<io::ImodTransform> transforms;
  for (const SimulatedView& view : views)
    transforms.push_back(geometry::invert(view.raw_from_aligned));
  io::write_imod_transforms(path, transforms);
}

// Writes the contrast transfer in the forms of two programs.
void write_ctf(const OutputFiles& files, const std::vector<SimulatedView>& views,
               const SimulationOptions& options) {
  std::vector<io::WrittenCtf> sections;
  for (const SimulatedView& view : views) sections.push_back({view.tilt_deg, view.defocus.value()});
  const microscope::Optics& optics = options.imaging.optics;
  io::write_ctffind(files.ctf, sections,
                    {optics.voltage_kV, optics.spherical_aberration_mm, optics.amplitude_contrast},
                    options.voxel_size_A);
  io::write_imod_defocus(files.defocus, sections);
}

void write_exposures(const OutputFiles& files, const std::vector<SimulatedView>& views,
                     const SimulationOptions& options) {
  io::Mdoc mdoc;
  mdoc.pixel_spacing_A = options.voxel_size_A;
  mdoc.image_file = files.series.filename().string();
  for (const SimulatedView& view : views) {
    io::MdocSection& section = mdoc.sections.emplace_back();
    section.section = std::ssize(mdoc.sections) - 1;
    section.tilt_deg = view.tilt_deg;
    section.dose = view.exposure.of_view;
    section.prior_dose = view.exposure.before;
  }
  io::write_mdoc(files.mdoc, mdoc);
}

// Returns the options of the cell, which must be wide enough for the tilts of the views.
CellOptions cell_options(const SimulationOptions& options,
                         const std::vector<SimulatedView>& views) {
  CellOptions cell = options.cell;
  cell.max_tilt_deg = 0.0;
  for (const SimulatedView& view : views)
    cell.max_tilt_deg = std::max(cell.max_tilt_deg, std::abs(view.tilt_deg));
  return cell;
}

// Says what is simulated; `reference` is what the truth shows.
SimulationSummary summary_of(const Phantom& phantom, const Phantom& reference,
                             const std::vector<SimulatedView>& views,
                             const SimulationOptions& options) {
  SimulationSummary summary;
  summary.num_beads = phantom.num_beads;
  summary.num_ellipsoids = static_cast<std::int64_t>(phantom.bodies.size()) - phantom.num_beads;
  summary.num_blobs = static_cast<std::int64_t>(phantom.blobs.size());
  summary.num_views = static_cast<std::int64_t>(views.size());
  summary.empty_beam = options.is_physical() ? electron_counts(options).behind_ice(0.0)
                                             : Detector(options).empty_beam();
  if (!options.dose && !options.is_physical())
    summary.sigma = noise_sigma(reference, views, options.noise);
  return summary;
}

// Writes the stacks of views, and what can be found in a physical specimen.
void write_stacks(const OutputFiles& files, const Phantom& phantom,
                  const std::optional<CryoSpecimen>& specimen,
                  const std::vector<SimulatedView>& views, const SimulationOptions& options,
                  std::optional<double> sigma, io::OutputSet& results) {
  if (specimen) {
    write_counts(files, phantom, views, options);
    write_labels(files, *specimen, options);
    return;
  }
  write_views(files, phantom, views, options, sigma);
  for (const fs::path& file : {files.even, files.odd, files.membranes, files.particles})
    results.remove_old(file);
}

// Writes the tables of angles, transforms, contrast transfer and exposures.
void write_tables(const OutputFiles& files, const std::vector<SimulatedView>& views,
                  const SimulationOptions& options, io::OutputSet& results) {
  write_angles(files.angles, views);
  if (options.misalignment.tilt_spread_deg > 0.0)
    write_recorded_angles(files.recorded_angles, views);
  else
    results.remove_old(files.recorded_angles);
  if (options.misalignment.is_none())
    results.remove_old(files.transforms);
  else
    write_transforms(files.transforms, views);
  if (options.imaging.defocus) {
    write_ctf(files, views, options);
  } else {
    results.remove_old(files.ctf);
    results.remove_old(files.defocus);
  }
  if (options.imaging.dose_per_tilt > 0.0)
    write_exposures(files, views, options);
  else
    results.remove_old(files.mdoc);
}

}  // namespace

SimulationSummary simulate_series(const fs::path& directory, const SimulationOptions& options,
                                  bool overwrite) {
  const auto faults = options.validate();
  if (!faults.empty()) throw Error(fmt::format("cannot simulate: {}", fmt::join(faults, "; ")));
  const auto views = plan_views(options);
  const CellOptions cell = cell_options(options, views);
  const io::OutputFolder folder(directory);
  require_disk(directory, cell, views.size(), options.write_truth);
  std::optional<CryoSpecimen> specimen;
  if (options.is_physical())
    specimen = make_cryo_specimen(cell, options.voxel_size_A, options.particle_files);
  std::optional<Phantom> cell_phantom;
  const Phantom& phantom =
      specimen ? specimen->phantom : cell_phantom.emplace(make_cell_phantom(cell));
  const Phantom reference = options.reference_has_beads ? phantom : without_beads(phantom);
  const OutputFiles files(directory, specimen ? specimen->kinds : std::vector<ParticleKind>());
  const std::vector<io::OutputLock> locks = claim_files(files, options, overwrite);

  // Files of an earlier run that this one does not replace would contradict the others.
  io::OutputSet results;
  SimulationSummary summary = summary_of(phantom, reference, views, options);
  if (specimen) summary.num_particles = std::ssize(specimen->particles);
  if (options.write_truth)
    summary.truth = write_truth(files.truth, reference, options);
  else
    results.remove_old(files.truth);
  write_stacks(files, phantom, specimen, views, options, summary.sigma, results);
  for (const fs::path& file : files.old_references) results.remove_old(file);
  write_tables(files, views, options, results);
  write_phantom_record(files.record, options, phantom, views, summary);
  results.commit();
  return summary;
}

}  // namespace tomofield::simulate
