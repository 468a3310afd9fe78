#pragma once

#include <string>
#include <vector>

namespace tomofield::batch {

/// Collects the mistakes of all series of a batch, so that a user sees them at once.
class Faults {
 public:
  void add(std::string sentence) { sentences_.push_back(std::move(sentence)); }
  /// Throws Error if there is a mistake. Of several, logs each on a line of its own before.
  void require_none() const;

 private:
  std::vector<std::string> sentences_;
};

}  // namespace tomofield::batch
