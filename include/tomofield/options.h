#pragma once

#include <tomofield/choice.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tomofield {

/// The look of dense matter in the views: dark (transmission images) or bright (phantoms, HAADF).
enum class Contrast { kDark, kBright };
/// The views stay where the files align them, or they are aligned further with the field itself,
/// or they are aligned from a raw stack of which the direction of the tilt axis is known.
enum class Alignment { kOff, kRefine, kFull };
/// Vector–matrix factors in every leaf, or plain trilinear vertices.
enum class FieldKind { kVm, kGrid };
/// All leaves alike, or finer leaves where the density varies more.
enum class TreeKind { kUniform, kAdaptive };
/// Decoded density, or softplus of it, which keeps it above zero.
enum class Activation { kSoftplus, kIdentity };
/// Projection along slabs of 16 rows with one tilt axis, or along single rays of any geometry.
enum class Engine { kSlab, kRay };
/// Total variation of the usual kind, or a concave penalty, which spares edges.
enum class Penalty { kConcave, kSmooth };
/// The fit ends with total variation, with little of it, or with a prior that was learned from
/// simulated series. The prior answers to the other two, which its training needs.
enum class Prior { kTv, kLight, kLearned };
/// The Fourier prior compares an axis with its ring's mean or largest amplitude.
enum class RingReference { kMean, kMax };
/// The noise of a view has the same power at all frequencies, or that of the residual.
enum class NoiseModel { kWhite, kColoured };
/// Order of the axes in a volume file: sections along Z, or along Y as IMOD's tilt writes them.
enum class VolumeAxes { kXyz, kXzy };
/// Type of a voxel in a volume file: MRC modes 2, 12 and 1 (scaled).
enum class VoxelType { kFloat32, kFloat16, kInt16 };

/// Version of OME-Zarr: 0.4 is a Zarr group of version 2, 0.5 one of version 3.
enum class ZarrVersion { k04, k05 };

/// The files that a tilt series is read from.
struct SeriesFiles {
  std::filesystem::path stack;                 ///< MRC or TIFF stack, raw or aligned
  std::optional<std::filesystem::path> tlt;    ///< .tlt or .rawtlt: an angle in degrees a section
  std::optional<std::filesystem::path> xf;     ///< IMOD raw-to-aligned transforms
  std::optional<std::filesystem::path> xtilt;  ///< IMOD x-axis tilt, degrees a section
  std::optional<std::filesystem::path> local;  ///< IMOD's local alignments
  std::optional<std::filesystem::path> aln;    ///< AreTomo alignment (angles, rotation, shifts)
  std::optional<std::filesystem::path> mdoc;   ///< SerialEM metadata (angles, pixel size)
  std::optional<std::filesystem::path> mask;   ///< MRC as the stack: 0 is no measurement
  std::optional<std::filesystem::path> fiducials;  ///< text of model2point, stack coordinates
  std::optional<std::filesystem::path> even;       ///< MRC as the stack: the even frames alone
  std::optional<std::filesystem::path> odd;        ///< and the odd frames
  std::optional<std::filesystem::path> ctf;  ///< contrast transfer of each view; "none": ignore it
  std::optional<std::filesystem::path> mtf;  ///< STAR: the detector's modulation transfer function
};

/// A rectangle [x0, x1) × [y0, y1) of pixels. A region of interest is one of the aligned view at
/// zero tilt; those of Options count unbinned pixels.
struct Rectangle {
  std::int64_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  std::int64_t width() const { return x1 - x0; }
  std::int64_t height() const { return y1 - y0; }
  bool operator==(const Rectangle&) const = default;
};

/// How the views are read, and what the microscope did to them. Lengths are unbinned pixels of the
/// aligned view.
struct ViewOptions {
  double tilt_offset_deg = 0;  ///< added to all tilt angles
  double x_axis_tilt_deg = 0;  ///< tilt of the specimen about X, which the volume turns back
  /// Direction of the tilt axis in a raw stack, counter-clockwise from +Y; default: what files
  /// state.
  std::optional<double> tilt_axis_deg;
  std::string exclude;                 ///< 1-based sections to leave out: "1-3,40"
  std::string ignore;                  ///< entries of other programs' files that are not applied
  double bin = 1.0;                    ///< reduce views by this factor, at least 1
  std::optional<double> angpix;        ///< or to this pixel size in Å
  std::optional<double> pixel_size_A;  ///< overrides the header's pixel size
  Contrast contrast = Contrast::kDark;
  bool take_log = false;       ///< −ln(I / I0) instead of I0 − I; dark contrast only
  double log_base = 0;         ///< added to intensities before the logarithm
  Choice<double> black_level;  ///< subtracted from bright intensities, in units of the stack
  /// Diameter of the gold beads that are looked for and masked; 0: none are. While it is open, the
  /// diameter is estimated if there clearly are beads. They are then masked in dark series, and
  /// trials decide on bright ones.
  Choice<double> bead_diameter_nm;
  bool remove_fixed_pattern = true;  ///< what stays at one place of the detector in all views

  std::optional<double> defocus_um;  ///< underfocus of all views, in place of SeriesFiles::ctf
  bool is_phase_flipped = false;     ///< the stack's phases were flipped
  /// 1, −1: the right, left side of a view at a positive tilt is farther from focus; default:
  /// SpecimenOptions::hand.
  std::optional<int> defocus_hand;
  std::optional<double> voltage_kV;               ///< default: that of the file, else 300
  std::optional<double> spherical_aberration_mm;  ///< default: that of the file, else 2.7
  std::optional<double> amplitude_contrast;       ///< default: that of the file, else 0.07
  std::optional<double> dose_per_tilt;            ///< electrons per Å² a view; 0: no damage
  bool is_dose_weighted = false;                  ///< the stack was filtered by exposure
};

/// The specimen as the user describes it. Lengths and positions are unbinned pixels of the aligned
/// view.
struct SpecimenOptions {
  double thickness = 0;          ///< of the tomogram along Z; required
  std::optional<Rectangle> roi;  ///< region of interest; default: the whole field of view
  int hand = 1;                  ///< 1: x = X cos + Z sin; −1: mirrored in Z
  std::optional<double> axis_x;  ///< tilt axis on the view; default: its centre
  std::optional<double> axis_z;  ///< tilt axis in the volume; default: its centre
  double shift_z = 0;            ///< moves the specimen up in the volume
};

/// The density field. Lengths are binned pixels. The values that Choice::usual() states are those
/// of a field that is made without resolve_options().
struct FieldOptions {
  /// Plain vertices, unless other options are for factors.
  Choice<FieldKind> kind = Choice<FieldKind>::usual(FieldKind::kVm);
  Choice<int> leaf_size = Choice<int>::usual(32);  ///< side of a leaf, a multiple of 16
  TreeKind tree = TreeKind::kUniform;  ///< an adaptive tree splits and merges leaves during the fit
  int leaf_budget = 0;          ///< most leaves of an adaptive tree; 0: as many as at the start
  double vertex_spacing = 1.0;  ///< between the vertices of a leaf, on all axes
  Choice<int> rank = Choice<int>::usual(24);  ///< components of each mode (vm)
  Choice<Activation> activation = Choice<Activation>::usual(Activation::kSoftplus);
  bool with_margin = true;      ///< false: the specimen ends inside the region of interest
  double margin_spacing = 2.0;  ///< between samples and between vertices of the margin
  std::string budget;           ///< makes the finished model compact: "0.1dB", "2M", "5MB"
  Choice<int> tile_rows;        ///< rows that are fitted and made compact at a time; 0: all

  /// Returns the spacing of vertices in the smallest leaves.
  double finest_spacing() const { return vertex_spacing / (tree == TreeKind::kAdaptive ? 2 : 1); }
};

/// The loss (eq. 9) and the schedule of a fit. The data term is ½ Σ (residual / σ)². The weights of
/// the other terms count in units of σ, the typical noise of a ray in density units times pixels,
/// so that the same weights serve every size and every series.
struct FitOptions {
  Choice<int> epochs = Choice<int>::usual(30);  ///< passes over all views at full resolution
  /// Passes before them with plain vertices, which then become factors; 0: none.
  Choice<int> vertex_epochs = Choice<int>::usual(0);
  /// Passes before all of these over binned views; 0: none.
  Choice<int> coarse_epochs = Choice<int>::usual(0);
  int coarse_bin = 4;  ///< the coarsest pixels on each axis, a power of two
  int subsets = 16;    ///< interleaved subsets of views: steps a pass
  Engine engine = Engine::kSlab;
  int ray_samples = 0;  ///< ray engine: along a leaf's diagonal (N_max of eq. 10); 0: one a pixel
  Choice<double> learning_rate = Choice<double>::usual(0.05);      ///< of the first step
  Choice<double> density_variation = Choice<double>::usual(14.0);  ///< weight of total variation
  double factor_variation = 0.0;  ///< weight of the factors' total variation
  Choice<Penalty> penalty = Choice<Penalty>::usual(Penalty::kConcave);  ///< of both variations
  /// How strongly to denoise: "light", "medium", "strong" or a factor. It multiplies the weight, be
  /// it given or chosen, by 0.5, 1, 2 or the factor.
  std::string denoise = "medium";
  /// The end of the fit. While it is open, a trial takes the learned prior unless that predicts
  /// views worse that were left out. With `penalty` or `density_variation`, it means kTv.
  Choice<Prior> prior = Choice<Prior>::usual(Prior::kTv);
  double boundary = 4.0;  ///< weight of the boundary consistency (eq. 6)
  double fourier = 0.0;   ///< weight of the isotropic Fourier prior (eq. 7)
  RingReference fourier_ring = RingReference::kMean;
  /// After each epoch, a plain vertex is at most the one of this rank among the 26 around it; 0: no
  /// limit.
  Choice<int> spike_rank = Choice<int>::usual(3);
  bool fit_noise = true;  ///< weight views by their residuals, and limit these
  NoiseModel noise_model = NoiseModel::kWhite;
  Choice<bool> fit_view_scale = Choice<bool>::usual(false);  ///< fit a scale and an offset a view
  int hold_out = 0;   ///< keep every Nth view from the fit and score it; 0: none
  bool tune = false;  ///< choose penalty, weight, rank and epochs by trials
  int patience = 0;   ///< epochs without a better held-out error; 0: never stop
  std::uint64_t seed = 1;
  bool split_tilts = false;       ///< fit the even and the odd tilts separately
  bool denoising_halves = false;  ///< write linear halves for denoisers as well
};

/// The file of a volume.
struct VolumeOptions {
  VoxelType voxel_type = VoxelType::kFloat32;  ///< kInt16 is scaled
  VolumeAxes axes = VolumeAxes::kXyz;
  bool invert = false;  ///< write the other contrast than the input's
  bool zarr = false;    ///< write the volume as OME-Zarr as well
  ZarrVersion zarr_version = ZarrVersion::k04;
};

/// The run: the alignment before the fit (docs/alignment.md), and its files.
struct RunOptions {
  Alignment align = Alignment::kOff;
  std::filesystem::path output;  ///< the tomogram; empty: results stay in memory
  bool overwrite = false;        ///< replace existing results
  bool resume = false;           ///< continue from the model file, if there is one
  double checkpoint_minutes = 5;
  bool alignment_json = false;  ///< write the alignment for the CryoET Data Portal as well
};

/// An option that a file sets, and where it says so: a file of another program, or the choice of a
/// batch.
struct Setting {
  std::string option;          ///< as users type it: "--thickness", or "stack"
  std::string value;           ///< as users type it; "true" for a flag
  std::filesystem::path file;  ///< "TS_01/tilt.com"
  std::string entry;           ///< the name in that file: "THICKNESS"
  std::string row = {};        ///< the name of its row, if the file lists several series
  std::string instead = {};  ///< what holds in its place: "--thickness 200"; empty: it holds itself
};

/// Everything that a user can choose for a reconstruction; docs/options.md lists flags, units,
/// ranges and defaults. Members that are std::optional follow from the data or from the files
/// unless they are given. Each layer of the program takes its own section.
struct Options {
  ViewOptions views;
  SpecimenOptions specimen;
  FieldOptions field;
  FitOptions fit;
  VolumeOptions volume;
  RunOptions run;
  std::vector<Setting> settings = {};   ///< what the files of a project set (open_project())
  std::vector<std::string> given = {};  ///< flags that the user gave, also with the default value
};

}  // namespace tomofield
