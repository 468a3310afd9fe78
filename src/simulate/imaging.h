#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "microscope/ctf.h"
#include "microscope/exposure.h"
#include "microscope/view_filter.h"
#include "simulate/phantom.h"
#include "simulate/project_phantom.h"

namespace tomofield::simulate {

/// Sets what the microscope does to the projections of a simulated series.
struct Imaging {
  struct Range {
    double low_um = 0.0, high_um = 0.0;
  };
  std::optional<Range> defocus;  ///< drawn for each view; none: no contrast transfer function
  /// Without it, each view draws its own defocus from the range. With it, the series draws one, and
  /// this is the standard deviation of the views about it.
  std::optional<double> defocus_scatter_um;
  double astigmatism_um = 0.0;  ///< u − v of each view, whose direction is drawn
  microscope::Optics optics;
  double dose_per_tilt = 0.0;  ///< electrons per Å²; 0: no radiation damage

  bool filters() const { return defocus.has_value() || dose_per_tilt > 0.0; }
};

/// Returns the defocus of each view in the recorded image, or none without a contrast transfer
/// function. It is that on the tilt axis.
std::vector<std::optional<io::Defocus>> draw_defoci(const Imaging& imaging, std::uint64_t seed,
                                                    std::size_t num_views);

/// Returns the indices of tilts in the dose-symmetric order (Hagen et al., J. Struct. Biol. 197,
/// 2017): from the tilt nearest to zero outwards, on the positive side first, then two tilts on
/// each side by turns.
std::vector<std::size_t> dose_symmetric_order(std::span<const double> tilts_deg);

/// Returns what turns a projection into a view. `defocus` is that of the recorded image.
microscope::ViewTransfer transfer_of(const ViewFrame& view, const Imaging& imaging,
                                     const std::optional<io::Defocus>& defocus, double exposure,
                                     double pixel_size_A);

/// Computes a view [height, width] as project_view() does, filtered by its contrast transfer, with
/// the defocus of each place on the tilted middle plane of the specimen, and by radiation damage
/// (microscope::ViewFilter). The projection that is filtered is wider on all sides than the view,
/// by as much as the filter moves what it shows.
void image_view(const Phantom& phantom, const ViewFrame& view, const Imaging& imaging,
                const std::optional<io::Defocus>& defocus, double exposure, double pixel_size_A,
                std::span<float> image);

}  // namespace tomofield::simulate
