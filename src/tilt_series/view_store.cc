#include "tilt_series/view_store.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "base/check.h"

namespace tomofield::tilt_series {
namespace {

std::size_t bytes_of(std::size_t num_views, std::int64_t width, std::int64_t height) {
  return num_views * static_cast<std::size_t>(width * height) * sizeof(float);
}

}  // namespace

ViewStore::ViewStore(std::size_t num_views, std::size_t capacity, std::int64_t width,
                     std::int64_t height, const std::filesystem::path& scratch_dir)
    : width_(width),
      height_(height),
      place_(num_views, kNowhere),
      memory_(bytes_of(capacity, width, height), "the decoded views", scratch_dir) {}

std::size_t ViewStore::resident_memory(std::size_t capacity, std::int64_t width,
                                       std::int64_t height) {
  const std::size_t all = bytes_of(capacity, width, height);
  return all <= io::ScratchMemory::kInMemoryBytes ? all : bytes_of(1, width, height);
}

std::size_t ViewStore::view_bytes() const { return bytes_of(1, width_, height_); }

void ViewStore::write(std::size_t view, const MaskedImage& image) {
  TOMOFIELD_CHECK(image.width == width_ && image.height == height_, "the view has another size");
  TOMOFIELD_CHECK(!holds(view), "the view was written before");
  const std::size_t place = used_.fetch_add(view_bytes());
  TOMOFIELD_CHECK(place + view_bytes() <= memory_.size(), "there is no room");
  std::vector<float> row(static_cast<std::size_t>(width_));
  for (std::size_t first = 0; first < image.values.size(); first += row.size()) {
    for (std::size_t x = 0; x < row.size(); ++x)
      row[x] = image.valid[first + x] ? image.values[first + x]
                                      : std::numeric_limits<float>::quiet_NaN();
    memory_.write(place + first * sizeof(float), std::as_bytes(std::span(row)));
  }
  place_[view] = place;
  memory_.release(place, view_bytes());
}

MaskedImage ViewStore::read(std::size_t view) const {
  TOMOFIELD_CHECK(holds(view), "the view was not written, or it was discarded");
  MaskedImage image(width_, height_);
  const float* from = reinterpret_cast<const float*>(memory_.data() + place_[view]);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    image.valid[i] = std::isnan(from[i]) ? 0 : 1;
    image.values[i] = image.valid[i] ? from[i] : 0.0f;
  }
  memory_.release(place_[view], view_bytes());
  return image;
}

void ViewStore::discard(std::size_t view) {
  TOMOFIELD_CHECK(holds(view), "the view was not written, or it was discarded");
  memory_.discard(place_[view], view_bytes());
  place_[view] = kNowhere;
}

}  // namespace tomofield::tilt_series
