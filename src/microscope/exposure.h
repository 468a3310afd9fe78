#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "io/tables/alignment_files.h"
#include "io/tables/view_table.h"

namespace tomofield::microscope {

/// Returns the exposure, in electrons per Å², after which the signal at a frequency, in cycles per
/// Å, has fallen to exp(−½). It is Grant and Grigorieff's fit 0.245 k^−1.665 + 2.81 at 300 kV
/// (eLife 4:e06980, 2015, equation 3), times 0.8 at 200 kV and 0.45 at 120 kV as in RELION, and
/// between these in proportion.
double critical_exposure(double k, double voltage_kV);

/// Returns the share of the signal that is left after an exposure, in electrons per Å²:
/// exp(−exposure / (2 critical exposure)). All of it is left at frequency 0.
double signal_after(double exposure, double k, double voltage_kV);

/// The electrons per Å² that came before a view and that the view received.
struct Exposure {
  double before = 0.0;   ///< by the specimen, when the view began
  double of_view = 0.0;  ///< by the view itself

  /// Returns the exposure at the middle of the view, which stands for the whole view.
  double at_middle() const { return before + of_view / 2; }
};

/// Returns the exposures of views that were recorded in this order of their indices, each with
/// `of_view` electrons per Å².
std::vector<Exposure> exposures_in_order(std::span<const std::size_t> order, double of_view);

/// Does the same with a dose for each view, by its index.
std::vector<Exposure> exposures_in_order(std::span<const std::size_t> order,
                                         std::span<const double> doses);

/// The exposure of each view that a file states, or why it is not known.
struct StatedExposures {
  std::optional<std::vector<Exposure>> of_view;  ///< [section] or [row]
  /// A phrase that names what is missing or cannot be; empty if the file has no doses at all.
  std::string fault = {};
};

/// Returns the exposures from PriorRecordDose if all sections have it and it is not 0 in all of
/// them, else from ExposureDose and the order of acquisition (io::acquisition_order()). They are
/// not known if these contradict a PriorRecordDose that some sections have, or if some have no
/// ExposureDose. SerialEM writes 0 if it does not know the dose.
StatedExposures exposures_of(const io::Mdoc& mdoc);

/// Returns true if an order of recording contradicts the PriorRecordDose of sections that have it.
bool contradicts_prior_doses(std::span<const std::size_t> order, const io::Mdoc& mdoc);

/// Returns the exposures of the views of a table of RELION or Warp; none if it has none, or if they
/// are 0 in all views. The exposure of a view itself is the smallest difference between two views,
/// because the tables do not have it. They are not known if two views that are used have the same
/// one before them, because each adds to it.
StatedExposures exposures_of(const io::ViewTable& table);

/// Returns the exposures of a list of tilts with doses; none if they are 0 in all views. They are
/// not known if a view alone has none.
StatedExposures exposures_of(const io::TiltTable& table);

}  // namespace tomofield::microscope
