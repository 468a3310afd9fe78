#pragma once

#include <span>
#include <vector>

namespace tomofield::alignment {

/// Returns true if a step of an iteration undoes more than a part of the last one, which went too
/// far then. Both have the same size. A last step of zeros is never undone.
bool turns_back(std::span<const double> step, std::span<const double> last, double part);

/// Chooses the factor by which the steps that registrations find are taken.
///
/// A registration to a field that was fitted to the view itself finds a part of the error, so
/// longer steps are taken. Where the noise is strong, the field follows the noise of the views to
/// their new places, and registrations find more than the error: long steps would go back and forth
/// for ever. So the factor falls each time a step undoes most of the last one. Steps that are no
/// more than noise turn back as well, but less.
class Relaxation {
 public:
  /// Returns the factor of the next step. `found` has one number for each thing that the step
  /// moves, as registrations found it.
  double next(std::vector<double> found);

 private:
  double factor_ = 1.3;
  std::vector<double> last_;
};

}  // namespace tomofield::alignment
