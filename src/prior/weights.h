#pragma once

#include <span>

namespace tomofield::prior {

/// Returns the weights of Network::trained(), which tools/train_prior made from simulated series
/// (docs/prior.md has their training).
std::span<const float> trained_weights();

}  // namespace tomofield::prior
