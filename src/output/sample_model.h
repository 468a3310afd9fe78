#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <vector>

#include "field/sampling/sample_box.h"
#include "output/model_file.h"

namespace tomofield::output {

/// Returns the bytes that the vertices of a compact model may take in memory: a quarter of what is
/// free.
std::size_t usual_decoded_bytes();

/// Reads a model to sample it. A compact model whose vertices take more than `most_bytes` is not
/// decoded: it has no `field`, and each request decodes the few bands that it needs. Throws Error
/// as load_model() does.
Model load_to_sample(const std::filesystem::path& path,
                     std::size_t most_bytes = usual_decoded_bytes());

/// Computes the densities of a box, whether the model is decoded or not.
void sample_box(const Model& model, const field::OrientedBox& box, const field::BoxSink& sink);
/// Does the same and returns them in the order [z, y, x].
std::vector<float> sample_box(const Model& model, const field::OrientedBox& box);

/// Returns the densities at points of the field, whether the model is decoded or not.
std::vector<float> sample_points(const Model& model, std::span<const field::Point> points);

}  // namespace tomofield::output
