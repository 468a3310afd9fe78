// tomofield._core: the C++ library as it is; tomofield/__init__.py makes it convenient.
#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <tomofield/baseline.h>
#include <tomofield/error.h>
#include <tomofield/evaluate.h>
#include <tomofield/messages.h>
#include <tomofield/model.h>
#include <tomofield/project.h>
#include <tomofield/reconstruct.h>
#include <tomofield/version.h>
#include <tomofield/volume_file.h>

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/nearest_names.h"
#include "baseline/method_options.h"
#include "option_table/rows.h"
#include "options.h"
#include "text.h"
#include "unlocked.h"

namespace tomofield::python {
namespace {

namespace py = pybind11;
// An array of numbers in C's order. The Python layer makes them of whatever a user gives
// (_checks.py): to do it here would run NumPy and code of the user below C++, which Python cannot
// unwind if the interpreter ends meanwhile.
template <class Number>
using Array = py::array_t<Number, py::array::c_style>;

// Hands a vector over to numpy without a copy.
py::array_t<float> to_array(std::vector<float> values, std::vector<py::ssize_t> shape) {
  auto owner = std::make_unique<std::vector<float>>(std::move(values));
  float* data = owner->data();
  const py::capsule free_it(owner.release(),
                            [](void* held) { delete static_cast<std::vector<float>*>(held); });
  return py::array_t<float>(std::move(shape), data, free_it);
}

py::array_t<float> to_volume(std::vector<float> values, const std::array<std::int64_t, 3>& size) {
  return to_array(std::move(values), {size[2], size[1], size[0]});
}

void require_dimensions(const py::array& array, py::ssize_t wanted, const char* what) {
  if (array.ndim() != wanted)
    throw Error(std::string(what) + ", not of " + std::to_string(array.ndim()) + " dimensions");
}

std::vector<float> values_of(const Array<float>& array) {
  return {array.data(), array.data() + array.size()};
}

using Places = std::array<std::array<double, 3>, 2>;

Tomogram to_tomogram(const Array<float>& array, double voxel_size_A,
                     const std::array<double, 3>& origin_A = {}) {
  require_dimensions(array, 3, "a volume is an array [z, y, x]");
  return {.size = {array.shape(2), array.shape(1), array.shape(0)},
          .voxel_size_A = voxel_size_A,
          .origin_A = origin_A,
          .values = values_of(array)};
}

TiltSeries series_of(const Array<float>& images, const Array<double>& tilts) {
  require_dimensions(images, 3, "a tilt series is an array [view, y, x]");
  require_dimensions(tilts, 1, "tilt angles are an array");
  return TiltSeries::from_images({.values = values_of(images),
                                  .width = images.shape(2),
                                  .height = images.shape(1),
                                  .tilt_deg = {tilts.data(), tilts.data() + tilts.size()}});
}

// Calls Python after every step: the user's callback, if any, and the handlers of signals. What
// they raise leaves the library's function once it has ended in order. It must outlive what it
// returns, since copies would count references without the interpreter's lock.
class Listener {
 public:
  explicit Listener(py::object callback) : callback_(std::move(callback)) {}

  ProgressCallback callback() const {
    return [this](const Progress& progress) {
      if (must_stop()) return false;
      const InUserCode locked;
      check_signals();
      if (callback_.is_none()) return true;
      const py::object answer = call(callback_, py::cast(progress));
      const int is_true = answer.is_none() ? 1 : PyObject_IsTrue(answer.ptr());
      if (is_true < 0) throw py::error_already_set();
      return is_true == 1;
    };
  }

 private:
  py::object callback_;
};

// Returns what work makes whose steps a listener follows, once all that signals have raised
// meanwhile was thrown.
template <typename Work>
auto run_with(py::object callback, const Work& work) {
  const Listener listener(std::move(callback));
  auto made = [&] {
    const Unlocked unlocked(Unlocked::Stops::kByCallback);
    return work(listener.callback());
  }();
  if (must_stop()) throw InterpreterEnds();
  check_signals();
  return made;
}

// Passes messages to the logger "tomofield". Whatever says something runs without the interpreter's
// lock, which is taken here: else two threads could wait for each other.
void log(MessageKind kind, std::string_view text) {
  const InUserCode locked;
  try {
    const py::str message = to_message(text);
    const py::object logger =
        call(py::module_::import("logging").attr("getLogger"), py::str("tomofield"));
    call(logger.attr(kind == MessageKind::kWarning ? "warning" : "info"), message);
  } catch (py::error_already_set& error) {
    if (error.matches(PyExc_Exception))
      error.discard_as_unraisable("tomofield's logger");
    else
      keep_for_later(std::current_exception());  // of a handler of signals, such as Ctrl-C
  }
}

// Reads a project, or takes the path of a stack. Returns its choices and its warnings, which go to
// the logger as well.
std::pair<option_table::Choices, std::vector<py::str>> open(const std::filesystem::path& path,
                                                            const std::string& series,
                                                            const std::string& ignore) {
  Project project;
  {
    const Unlocked unlocked;
    project = open_project({path, series, ignore});
    for (const std::string& warning : project.warnings) log(MessageKind::kWarning, warning);
  }
  check_signals();
  std::vector<py::str> warnings;
  for (const std::string& warning : project.warnings) warnings.push_back(to_message(warning));
  return {{std::move(project.files), std::move(project.options)}, std::move(warnings)};
}

bool align_series(const TiltSeries& series, const option_table::Choices& choices,
                  py::object callback) {
  return run_with(std::move(callback), [&](const ProgressCallback& progress) {
    return align(series, choices.options, progress);
  });
}

// Returns a volume in memory as numbers, the size of a voxel and the place of its corner.
py::tuple to_tuple(Tomogram tomogram) {
  return py::make_tuple(to_volume(std::move(tomogram.values), tomogram.size), tomogram.voxel_size_A,
                        tomogram.origin_A);
}

py::dict run(const TiltSeries& series, const option_table::Choices& choices, py::object callback) {
  Reconstruction made = run_with(std::move(callback), [&](const ProgressCallback& progress) {
    return reconstruct(series, choices.options, progress);
  });
  py::dict result;
  result["is_finished"] = made.is_finished;
  result["metrics"] = made.metrics;
  result["model"] = made.model;
  result["choices"] = option_table::Choices{choices.files, made.options};
  result["tomogram"] = py::none();
  if (made.tomogram) result["tomogram"] = to_tuple(std::move(*made.tomogram));
  return result;
}

py::dict run_baseline(const TiltSeries& series, BaselineMethod method,
                      const option_table::Choices& choices, const MethodOptions& method_options,
                      py::object callback) {
  Baseline made = run_with(std::move(callback), [&](const ProgressCallback& progress) {
    return reconstruct_baseline(series, method, choices.options, method_options, progress);
  });
  py::dict result;
  result["is_finished"] = made.is_finished;
  result["metrics"] = made.metrics;
  result["tomogram"] = py::none();
  if (made.tomogram) result["tomogram"] = to_tuple(std::move(*made.tomogram));
  return result;
}

// Angles as Python has them: (pitch, x_tilt).
std::optional<Levelling> levelling_of(const std::optional<std::pair<double, double>>& level) {
  if (!level) return std::nullopt;
  return Levelling{.pitch_deg = level->first, .x_tilt_deg = level->second};
}

VolumeFile file_of(const std::filesystem::path& path, const option_table::Choices& choices) {
  return {path, choices.options.volume, choices.options.run.overwrite};
}

std::pair<double, double> level_found(const Model& model) {
  const Unlocked unlocked;
  const Levelling found = found_levelling(model);
  return {found.pitch_deg, found.x_tilt_deg};
}

void export_box(const Model& model, const std::optional<SampleBox>& box, double voxel_px,
                const std::optional<std::pair<double, double>>& level,
                const std::filesystem::path& path, const option_table::Choices& choices) {
  const Unlocked unlocked;
  export_volume(model, {.box = box, .voxel_px = voxel_px, .level = levelling_of(level)},
                file_of(path, choices));
}

std::pair<std::size_t, std::size_t> cut_particles(
    const Model& model, const std::filesystem::path& list, std::int64_t size, double voxel_px,
    const std::string& tomogram, const std::optional<std::pair<double, double>>& level,
    const std::filesystem::path& path, const option_table::Choices& choices) {
  const Unlocked unlocked;
  const auto [count, num_beyond] = export_particles(model,
                                                    {.list = list,
                                                     .size = size,
                                                     .voxel_px = voxel_px,
                                                     .tomogram = tomogram,
                                                     .level = levelling_of(level)},
                                                    file_of(path, choices));
  return {count, num_beyond};
}

py::tuple read_volume(const std::filesystem::path& path) {
  Tomogram volume;
  {
    const Unlocked unlocked;
    volume = read_mrc(path);
  }
  return to_tuple(std::move(volume));
}

void write_volume(const Array<float>& volume, double voxel_size_A,
                  const std::array<double, 3>& origin_A, const std::filesystem::path& path,
                  bool overwrite) {
  const Tomogram tomogram = to_tomogram(volume, voxel_size_A, origin_A);
  const Unlocked unlocked;
  write_mrc(tomogram, path, overwrite);
}

py::array_t<float> sample(const Model& model, const SampleBox& box) {
  std::vector<float> values;
  {
    const Unlocked unlocked;
    values = model.sample(box);
  }
  return to_volume(std::move(values), box.size);
}

py::array_t<float> sample_points(const Model& model, const Array<double>& points) {
  if (points.ndim() != 2 || points.shape(1) != 3)
    throw Error("points are an array of N rows with x, y and z");
  constexpr py::ssize_t kRowsAtOnce = py::ssize_t{1} << 20;
  std::vector<Point> list;
  list.reserve(static_cast<std::size_t>(points.shape(0)));
  for (py::ssize_t i = 0; i < points.shape(0); ++i) {
    if (i % kRowsAtOnce == 0) check_signals();
    list.push_back({*points.data(i, 0), *points.data(i, 1), *points.data(i, 2)});
  }
  std::vector<float> values;
  {
    const Unlocked unlocked;
    values = model.sample_points(list);
  }
  return to_array(std::move(values), {points.shape(0)});
}

// Returns what the values of a method's options are, by their names: the kind, and whether they may
// be "auto".
std::map<std::string, std::pair<std::string, bool>> method_options(const std::string& method) {
  std::map<std::string, std::pair<std::string, bool>> kinds;
  const auto word = [](baseline::ValueKind kind) {
    switch (kind) {
      case baseline::ValueKind::kSwitch:
        return "True or False";
      case baseline::ValueKind::kWholeNumber:
        return "a whole number";
      case baseline::ValueKind::kNumber:
        return "a number";
      case baseline::ValueKind::kWord:
        break;
    }
    return "a text";
  };
  for (const baseline::MethodOption& option :
       baseline::options_of(baseline::method_named(method).value()))
    kinds.emplace(option.flag.substr(2),
                  std::pair(word(baseline::kind_of(option)), baseline::may_be_open(option)));
  return kinds;
}

// Returns the options of the table that a method takes.
std::vector<std::string> shared_options(const std::string& method) {
  std::vector<std::string> names;
  for (const option_table::Row& row : option_table::all_rows())
    if (baseline::takes_option(baseline::method_named(method).value(), row))
      names.emplace_back(row.name);
  return names;
}

void add_reconstruct(py::module_& module) {
  py::class_<TiltSeries>(module, "TiltSeries")
      .def_static("from_files",
                  [](const option_table::Choices& choices) {
                    const Unlocked unlocked;
                    return TiltSeries::from_files(choices.files);
                  })
      .def_static("from_images", &series_of, py::arg("views").noconvert(),
                  py::arg("tilts_deg").noconvert());
  py::class_<Progress>(module, "Progress", "How far a reconstruction is.")
      .def_readonly("fraction_done", &Progress::fraction_done, "from 0 to 1")
      .def_readonly("seconds_elapsed", &Progress::seconds_elapsed)
      .def_readonly("seconds_left", &Progress::seconds_left)
      .def_readonly("is_trial", &Progress::is_trial,
                    "True for trials that choose settings before the fit")
      .def_readonly("detail", &Progress::detail, "a few words: epoch, loss, steps a second");
  py::enum_<BaselineMethod>(module, "BaselineMethod")
      .value("wbp", BaselineMethod::kWbp)
      .value("sirt", BaselineMethod::kSirt)
      .value("sart-tv", BaselineMethod::kSartTv)
      .value("tv", BaselineMethod::kTv)
      .value("ingp", BaselineMethod::kIngp)
      .value("fourier-net", BaselineMethod::kFourierNet);
  module.def("open_project", &open);
  module.def("align", &align_series);
  module.def("reconstruct", &run);
  module.def("baseline", &run_baseline);
  module.def("method_options", &method_options);
  module.def("shared_options", &shared_options);
  module.def("nearest_names", &base::nearest_names);
  module.def("set_thread_count", &set_thread_count);
}

void add_model(py::module_& module) {
  py::class_<SampleBox>(module, "SampleBox")
      .def(py::init([](const Point& centre_px, const std::array<std::int64_t, 3>& size,
                       double voxel_px, const std::array<double, 3>& euler_deg) {
        return SampleBox{centre_px, size, voxel_px, euler_deg};
      }))
      .def_readonly("centre_px", &SampleBox::centre_px)
      .def_readonly("size", &SampleBox::size)
      .def_readonly("voxel_px", &SampleBox::voxel_px)
      .def_readonly("euler_deg", &SampleBox::euler_deg);
  py::class_<Model>(module, "Model")
      .def(py::init<const std::filesystem::path&>(), py::call_guard<Unlocked>())
      .def("pixel_size_A", &Model::pixel_size_A)
      .def("region", &Model::region)
      .def("sample", &sample)
      .def("sample_points", &sample_points, py::arg("rows").noconvert());
  module.def("found_levelling", &level_found);
  module.def("export_box", &export_box);
  module.def("export_particles", &cut_particles);
  module.def("read_mrc", &read_volume);
  module.def("write_mrc", &write_volume, py::arg("volume").noconvert(), py::arg("voxel_size_A"),
             py::arg("origin_A"), py::arg("path"), py::arg("overwrite"));
}

std::optional<double> resolution_at(const ShellCorrelation& curve, const py::object& threshold) {
  if (!py::isinstance<py::float_>(threshold) && !py::isinstance<py::int_>(threshold))
    throw py::type_error("the threshold is a number, not " +
                         py::repr(threshold).cast<std::string>());
  return resolution_A(curve, threshold.cast<double>());
}

void add_evaluate(py::module_& module) {
  py::class_<VolumeScores>(module, "VolumeScores", "How alike a volume is to the truth.")
      .def_readonly("psnr_raw_dB", &VolumeScores::psnr_raw_dB)
      .def_readonly("psnr_affine_dB", &VolumeScores::psnr_affine_dB,
                    "after the best scale and offset")
      .def_readonly("ssim_raw", &VolumeScores::ssim_raw)
      .def_readonly("ssim_affine", &VolumeScores::ssim_affine)
      .def_readonly("correlation", &VolumeScores::correlation)
      .def_readonly("scale", &VolumeScores::scale)
      .def_readonly("offset", &VolumeScores::offset)
      .def_readonly("peak", &VolumeScores::peak);
  py::class_<ShellCorrelation>(module, "ShellCorrelation", "Fourier shell correlation, by shell.")
      .def_readonly("frequency_per_A", &ShellCorrelation::frequency_per_A)
      .def_readonly("correlation", &ShellCorrelation::correlation)
      .def_readonly("voxels", &ShellCorrelation::voxels)
      .def("resolution_A", &resolution_at, py::arg("threshold") = 0.143,
           "Return where the correlation first falls below a threshold, in Å, or None.");
  module.def(
      "score_volume",
      [](const Array<float>& volume, const Array<float>& truth, double volume_A, double truth_A,
         const Places& origins_A) {
        const Tomogram a = to_tomogram(volume, volume_A, origins_A[0]);
        const Tomogram b = to_tomogram(truth, truth_A, origins_A[1]);
        const Unlocked unlocked;
        return score_volume(a, b);
      },
      py::arg("volume").noconvert(), py::arg("truth").noconvert(), py::arg("volume_A"),
      py::arg("truth_A"), py::arg("origins_A"));
  module.def(
      "correlate_shells",
      [](const Array<float>& first, const Array<float>& second, double first_A, double second_A,
         const Places& origins_A) {
        const Tomogram a = to_tomogram(first, first_A, origins_A[0]);
        const Tomogram b = to_tomogram(second, second_A, origins_A[1]);
        const Unlocked unlocked;
        return correlate_shells(a, b);
      },
      py::arg("first").noconvert(), py::arg("second").noconvert(), py::arg("first_A"),
      py::arg("second_A"), py::arg("origins_A"));
}

}  // namespace
}  // namespace tomofield::python

PYBIND11_MODULE(_core, module) {
  using namespace tomofield;
  pybind11::exception<Error>(module, "Error", PyExc_RuntimeError);
  pybind11::register_exception_translator([](std::exception_ptr raised) {
    const auto raise = [](const std::string& said) {
      const auto type = pybind11::module_::import("tomofield._core").attr("Error");
      PyErr_SetObject(type.ptr(), python::to_message(said).ptr());
    };
    try {
      if (raised) std::rethrow_exception(raised);
    } catch (const python::InterpreterEnds&) {
      python::InterpreterEnds::raise();
    } catch (const Error& error) {
      raise(error.what());
    } catch (const std::filesystem::filesystem_error& error) {
      raise("'" + error.path1().string() + "' cannot be used: " + error.code().message());
    }
  });
  module.attr("Error").attr("__doc__") =
      "A file, an array or an option cannot be used. The sentence says what, where, and what to "
      "do.";
  module.attr("__version__") = library_version();
  set_message_handler(python::log);
  python::wait_at_exit();
  python::add_options(module);
  python::add_reconstruct(module);
  python::add_model(module);
  python::add_evaluate(module);
}
