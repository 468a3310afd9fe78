#include "options.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <tomofield/error.h>
#include <tomofield/options.h>

#include <array>
#include <optional>
#include <string>
#include <utility>

#include "base/enum_names.h"

namespace tomofield::python {
namespace {

namespace py = pybind11;
using Class = py::class_<Options>;

// Names types as numpy does; the command line names the modes of MRC files.
struct VoxelTypeNames {
  static constexpr std::array kNames{std::pair{VoxelType::kFloat32, "float32"},
                                     std::pair{VoxelType::kFloat16, "float16"},
                                     std::pair{VoxelType::kInt16, "int16"}};
};

template <typename Names, typename Enum>
std::string name_of(Enum value) {
  for (const auto& [known, name] : Names::kNames)
    if (known == value) return name;
  return "";
}

template <typename Names, typename Enum>
Enum value_named(const char* option, const std::string& name) {
  std::string choices;
  for (const auto& [value, choice] : Names::kNames) {
    if (name == choice) return value;
    choices += (choices.empty() ? "'" : ", '") + std::string(choice) + "'";
  }
  throw Error(std::string("the option ") + option + " is one of " + choices + ", not '" + name +
              "'");
}

template <typename Enum, typename Names = base::EnumNames<Enum>>
void add_choice(Class& options, const char* name, Enum Options::*member) {
  options.def_property(
      name, [member](const Options& o) { return name_of<Names>(o.*member); },
      [name, member](Options& o, const std::string& word) {
        o.*member = value_named<Names, Enum>(name, word);
      });
}

template <typename Enum, typename Names = base::EnumNames<Enum>>
void add_choice(Class& options, const char* name, std::optional<Enum> Options::*member) {
  options.def_property(
      name,
      [member](const Options& o) {
        return o.*member ? std::optional(name_of<Names>(*(o.*member))) : std::nullopt;
      },
      [name, member](Options& o, const std::optional<std::string>& word) {
        o.*member = word ? std::optional(value_named<Names, Enum>(name, *word)) : std::nullopt;
      });
}

// x0, y0, x1, y1
void add_rectangle(Class& options) {
  using Corners = std::array<std::int64_t, 4>;
  options.def_property(
      "roi",
      [](const Options& o) {
        return o.roi ? std::optional(Corners{o.roi->x0, o.roi->y0, o.roi->x1, o.roi->y1})
                     : std::nullopt;
      },
      [](Options& o, const std::optional<Corners>& c) {
        o.roi = c ? std::optional(Rectangle{(*c)[0], (*c)[1], (*c)[2], (*c)[3]}) : std::nullopt;
      });
}

void add_files(py::module_& module) {
  py::class_<SeriesFiles>(module, "SeriesFiles")
      .def(py::init())
      .def_readwrite("stack", &SeriesFiles::stack)
      .def_readwrite("tlt", &SeriesFiles::tlt)
      .def_readwrite("xf", &SeriesFiles::xf)
      .def_readwrite("xtilt", &SeriesFiles::xtilt)
      .def_readwrite("aln", &SeriesFiles::aln)
      .def_readwrite("mdoc", &SeriesFiles::mdoc)
      .def_readwrite("mask", &SeriesFiles::mask)
      .def_readwrite("fiducials", &SeriesFiles::fiducials)
      .def_readwrite("even", &SeriesFiles::even)
      .def_readwrite("odd", &SeriesFiles::odd)
      .def_readwrite("ctf", &SeriesFiles::ctf)
      .def_readwrite("mtf", &SeriesFiles::mtf);
}

void add_views_and_specimen(Class& options) {
  options.def_readwrite("tilt_offset_deg", &Options::tilt_offset_deg)
      .def_readwrite("x_axis_tilt_deg", &Options::x_axis_tilt_deg)
      .def_readwrite("tilt_axis_deg", &Options::tilt_axis_deg)
      .def_readwrite("exclude", &Options::exclude)
      .def_readwrite("ignore", &Options::ignore)
      .def_readwrite("bin", &Options::bin)
      .def_readwrite("angpix", &Options::angpix)
      .def_readwrite("pixel_size_A", &Options::pixel_size_A)
      .def_readwrite("take_log", &Options::take_log)
      .def_readwrite("log_base", &Options::log_base)
      .def_readwrite("black_level", &Options::black_level)
      .def_readwrite("bead_diameter_nm", &Options::bead_diameter_nm)
      .def_readwrite("remove_fixed_pattern", &Options::remove_fixed_pattern)
      .def_readwrite("thickness", &Options::thickness)
      .def_readwrite("hand", &Options::hand)
      .def_readwrite("axis_x", &Options::axis_x)
      .def_readwrite("axis_z", &Options::axis_z)
      .def_readwrite("shift_z", &Options::shift_z)
      .def_readwrite("with_margin", &Options::with_margin);
  add_choice(options, "contrast", &Options::contrast);
  add_rectangle(options);
}

void add_contrast_transfer(Class& options) {
  options.def_readwrite("defocus_um", &Options::defocus_um)
      .def_readwrite("is_phase_flipped", &Options::is_phase_flipped)
      .def_readwrite("defocus_hand", &Options::defocus_hand)
      .def_readwrite("voltage_kV", &Options::voltage_kV)
      .def_readwrite("spherical_aberration_mm", &Options::spherical_aberration_mm)
      .def_readwrite("amplitude_contrast", &Options::amplitude_contrast)
      .def_readwrite("dose_per_tilt", &Options::dose_per_tilt)
      .def_readwrite("is_dose_weighted", &Options::is_dose_weighted);
}

void add_field_and_fit(Class& options) {
  options.def_readwrite("leaf_size", &Options::leaf_size)
      .def_readwrite("leaf_budget", &Options::leaf_budget)
      .def_readwrite("vertex_spacing", &Options::vertex_spacing)
      .def_readwrite("rank", &Options::rank)
      .def_readwrite("margin_spacing", &Options::margin_spacing)
      .def_readwrite("budget", &Options::budget)
      .def_readwrite("tile_rows", &Options::tile_rows)
      .def_readwrite("epochs", &Options::epochs)
      .def_readwrite("vertex_epochs", &Options::vertex_epochs)
      .def_readwrite("coarse_epochs", &Options::coarse_epochs)
      .def_readwrite("coarse_bin", &Options::coarse_bin)
      .def_readwrite("subsets", &Options::subsets)
      .def_readwrite("ray_samples", &Options::ray_samples)
      .def_readwrite("rays_per_step", &Options::rays_per_step)
      .def_readwrite("learning_rate", &Options::learning_rate)
      .def_readwrite("density_variation", &Options::density_variation)
      .def_readwrite("denoise", &Options::denoise)
      .def_readwrite("factor_variation", &Options::factor_variation)
      .def_readwrite("boundary", &Options::boundary)
      .def_readwrite("fourier", &Options::fourier)
      .def_readwrite("spike_rank", &Options::spike_rank)
      .def_readwrite("fit_noise", &Options::fit_noise)
      .def_readwrite("fit_view_scale", &Options::fit_view_scale)
      .def_readwrite("hold_out", &Options::hold_out)
      .def_readwrite("tune", &Options::tune)
      .def_readwrite("patience", &Options::patience)
      .def_readwrite("seed", &Options::seed);
  add_choice(options, "align", &Options::align);
  add_choice(options, "field", &Options::field);
  add_choice(options, "tree", &Options::tree);
  add_choice(options, "activation", &Options::activation);
  add_choice(options, "engine", &Options::engine);
  add_choice(options, "penalty", &Options::penalty);
  add_choice(options, "prior", &Options::prior);
  add_choice(options, "fourier_ring", &Options::fourier_ring);
  add_choice(options, "noise_model", &Options::noise_model);
}

void add_halves_volume_and_run(Class& options) {
  options.def_readwrite("split_tilts", &Options::split_tilts)
      .def_readwrite("denoising_halves", &Options::denoising_halves)
      .def_readwrite("invert", &Options::invert)
      .def_readwrite("zarr", &Options::zarr)
      .def_readwrite("output", &Options::output)
      .def_readwrite("overwrite", &Options::overwrite)
      .def_readwrite("resume", &Options::resume)
      .def_readwrite("checkpoint_minutes", &Options::checkpoint_minutes)
      .def_readwrite("alignment_json", &Options::alignment_json);
  add_choice<VoxelType, VoxelTypeNames>(options, "voxel_type", &Options::voxel_type);
  add_choice(options, "axes", &Options::axes);
}

}  // namespace

void add_options(py::module_& module) {
  add_files(module);
  Class options(module, "Options");
  options.def(py::init());
  add_views_and_specimen(options);
  add_contrast_transfer(options);
  add_field_and_fit(options);
  add_halves_volume_and_run(options);
}

}  // namespace tomofield::python
