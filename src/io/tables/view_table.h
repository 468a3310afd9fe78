#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/plausible.h"

namespace tomofield::io {

/// Where a program puts the centre of N pixels, as a zero-based index of pixels whose middles are
/// at whole numbers.
enum class CentreRule {
  kWholePixel,  ///< int(N / 2): RELION
  kHalfSize     ///< N / 2, which lies between two pixels if N is odd: Warp
};

/// Returns how far that centre is from the middle of the pixels, in pixels (docs/geometry.md).
double distance_from_middle_px(CentreRule rule, std::int64_t num_pixels);

/// The contrast transfer of a view, as a file of another program states it.
struct Defocus {
  double u_A = 0.0, v_A = 0.0;  ///< underfocus is positive
  double angle_deg = 0.0;       ///< direction of u, counter-clockwise from x
  double phase_shift_deg = 0.0;
};

/// The microscope as a file states it; none: it is not in the file.
struct StatedOptics {
  std::optional<double> voltage_kV, spherical_aberration_mm, amplitude_contrast;
  std::optional<double> pixel_size_A = {};  ///< of the images in which the defocus was measured
};

/// Voltages that microscopes have.
inline constexpr base::Interval kVoltages_kV{20, 3000};

/// Throws Error with the file and the value for optics that no microscope has.
void require_possible(const StatedOptics& optics, const std::filesystem::path& file);

/// One view of a tilt series: where its images lie, and how the specimen is projected to them. With
/// positions from the centres of the specimen and of the image, the rotations right-handed, and
/// only x and y of the result:
///
///     p = Rz(rotation) Ry(tilt) Rx(x_tilt) P + shift
struct ListedView {
  std::string image;      ///< as the file writes it: "dir/a.mrc", "000001@stack.mrc"
  std::string even, odd;  ///< images of half of the frames; empty: not in the file
  bool is_used = true;    ///< false: another program left the view out
  double tilt_deg = 0.0;  ///< rotation about +Y
  /// The tilt and the axis that the microscope states, where the table has refined ones, too.
  std::optional<double> nominal_tilt_deg{}, nominal_axis_deg{};
  double x_tilt_deg = 0.0;    ///< rotation about +X, before the tilt
  double rotation_deg = 0.0;  ///< of the tilt axis, counter-clockwise from +Y
  double shift_x_A = 0.0;     ///< in the recorded image
  double shift_y_A = 0.0;
  std::optional<double> dose_before;  ///< electrons per Å² before the view
  std::optional<Defocus> defocus;
};

/// A tilt series as RELION or Warp writes it: one view a row.
struct ViewTable {
  std::filesystem::path file;
  CentreRule centre = CentreRule::kWholePixel;
  bool names_movies = false;  ///< Warp: the images are averages beside the movies
  std::vector<ListedView> views;
  std::optional<double> thickness_A;     ///< of the volume that the other program makes
  std::vector<std::string> not_applied;  ///< what the file has and a rigid alignment cannot honour
  std::vector<std::string> ctf_not_applied{};  ///< the same of the contrast transfer
  std::vector<std::string> remarks{};          ///< sentences on what the file lacks, or has in vain
  std::optional<std::array<double, 2>> image_size_A{};  ///< width and height
  StatedOptics optics{};
  /// 1 or −1: the right or the left side of an aligned view at a positive tilt_deg is farther from
  /// focus. None if the file does not say.
  std::optional<int> defocus_hand{};
  /// The views are not aligned yet: the angles are the nominal ones of the microscope.
  bool is_nominal = false;
};

/// Returns true if every view of a table that is used has a defocus.
bool has_defocus(const ViewTable& table);

/// Returns true if a name ends like that of a table of views: .star, .tomostar, or .xml.
bool is_view_table(const std::filesystem::path& path);

/// Returns the table that "even@TABLE" or "odd@TABLE" names, and other paths as they are.
std::filesystem::path without_half(const std::filesystem::path& path);

/// Reads a tilt-series STAR file of RELION 5, a .tomostar or an XML file of Warp, which may be
/// named with a half of the frames (without_half()). Throws Error with the file and the row for
/// what is missing or cannot be.
ViewTable read_view_table(const std::filesystem::path& path);

/// These read one kind each.
ViewTable read_relion_views(const std::filesystem::path& path);
ViewTable read_warp_tomostar(const std::filesystem::path& path);
ViewTable read_warp_xml(const std::filesystem::path& path);

}  // namespace tomofield::io
