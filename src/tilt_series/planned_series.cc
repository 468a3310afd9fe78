#include "tilt_series/planned_series.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>

#include "io/saving/file_identity.h"
#include "io/tables/mdoc_images.h"
#include "io/tables/view_table.h"
#include "tilt_series/decode_view.h"
#include "tilt_series/half_stacks.h"
#include "tilt_series/masks/series_masks.h"
#include "tilt_series/own_views.h"
#include "tilt_series/resampling/binning.h"
#include "tilt_series/view_store.h"
#include "tomofield/error.h"

namespace tomofield::tilt_series {
namespace {

// Says whether two stacks are one file. "even@TABLE" and "odd@TABLE" are two stacks of one table.
bool are_one_stack(const std::filesystem::path& a, const std::filesystem::path& b) {
  const std::string table_a = io::without_half(a).string(), table_b = io::without_half(b).string();
  const bool is_same_half = a.string().substr(0, a.string().size() - table_a.size()) ==
                            b.string().substr(0, b.string().size() - table_b.size());
  return is_same_half && io::identity_of(table_a) == io::identity_of(table_b);
}

// Refuses halves that are one file, or that are the stack of all frames: their noise would be one.
void require_two_halves(const TiltSeriesOptions& options) {
  const std::filesystem::path &even = *options.even, &odd = *options.odd;
  const auto refuse_if_same = [](const std::filesystem::path& a, const std::filesystem::path& b,
                                 const char* what) {
    if (are_one_stack(a, b))
      throw Error(fmt::format("'{}' and '{}' are one file: {}", a.string(), b.string(), what));
  };
  refuse_if_same(even, odd, "give --even and --odd the stacks of two halves of the frames");
  if (options.images) return;
  for (const auto& half : {even, odd})
    refuse_if_same(half, options.stack, "a half of the frames is not the stack of all of them");
}

// Refuses files beside the stack that do not fit it, before any view is decoded.
void check_companions(const TiltSeriesOptions& options, const io::ImageStack& stack) {
  if (options.mask) open_mask(*options.mask, stack);
  if (!options.even || !options.odd) return;
  require_two_halves(options);
  HalfStacks({*options.even, *options.odd}, stack);
}

// Refuses views in which nothing can be seen.
void require_pixels(const PlannedSeries& series) {
  constexpr std::int64_t kFewest = 8;
  const std::int64_t width = series.aligned_width(), height = series.aligned_height();
  if (std::min(width, height) >= kFewest) return;
  throw Error(
      fmt::format("views of {} × {} pixels show nothing: they need at least {} along both sides, "
                  "after --bin; give a smaller --bin, or check the size in the stack's header",
                  width, height, kFewest));
}

}  // namespace

std::shared_ptr<const io::ImageStack> open_views(const TiltSeriesOptions& options) {
  if (options.images) return options.images;
  std::error_code absent;
  if (options.mdoc && std::filesystem::is_directory(options.stack, absent))
    return io::open_mdoc_images(*options.mdoc, options.stack);
  return io::open_image_stack(options.stack);
}

struct PlannedSeries::Impl {
  TiltSeriesOptions options;
  std::shared_ptr<const io::ImageStack> stack;
  SeriesPlan plan;
  std::vector<View> views;
  base::LogMessages messages;
};

PlannedSeries::PlannedSeries(const TiltSeriesOptions& options,
                             const distributed::Communicator& processes) {
  processes.run_collectively([&] {
    base::HeldLog log;
    Impl series{options, open_views(options), {}, {}, {}};
    series.plan = plan_series(options, *series.stack);
    check_companions(options, *series.stack);
    for (const PlannedView& planned : series.plan.views) series.views.push_back(planned.view);
    series.messages = log.take();
    impl_ = std::make_shared<const Impl>(std::move(series));
    require_pixels(*this);
  });
}

const std::vector<View>& PlannedSeries::views() const { return impl_->views; }
std::int64_t PlannedSeries::width() const {
  return is_resampled() ? aligned_width() : reduced_size(stack().header().nx, bin_factor());
}
std::int64_t PlannedSeries::height() const {
  return is_resampled() ? aligned_height() : reduced_size(stack().header().ny, bin_factor());
}
std::int64_t PlannedSeries::aligned_width() const {
  return reduced_size(plan().aligned_width, bin_factor());
}
std::int64_t PlannedSeries::aligned_height() const {
  return reduced_size(plan().aligned_height, bin_factor());
}
bool PlannedSeries::is_resampled() const { return options().resample; }
geometry::RawFromAligned PlannedSeries::raw_from_aligned(std::size_t view) const {
  return plan().views[view].raw_from_aligned.binned(bin_factor());
}
double PlannedSeries::pixel_size_A() const { return plan().pixel_size_A * bin_factor(); }
double PlannedSeries::bin_factor() const { return plan().bin_factor; }
const std::optional<StatedAxis>& PlannedSeries::stated_axis() const { return plan().axis; }

std::size_t PlannedSeries::decoding_memory() const {
  const auto& header = stack().header();
  return tilt_series::decoding_memory(static_cast<double>(header.nx * header.ny), bin_factor());
}

std::size_t PlannedSeries::stored_memory(const distributed::Communicator& processes) const {
  const std::size_t capacity = max_own_views(views().size(), processes);
  const std::size_t stored = ViewStore::resident_memory(capacity, width(), height());
  if (is_resampled() || !searches_beads(options())) return stored;
  // The search for beads needs aligned views beside those that were recorded.
  return stored + ViewStore::resident_memory(capacity, aligned_width(), aligned_height());
}

const TiltSeriesOptions& PlannedSeries::options() const { return impl_->options; }
const io::ImageStack& PlannedSeries::stack() const { return *impl_->stack; }
const SeriesPlan& PlannedSeries::plan() const { return impl_->plan; }
const base::LogMessages& PlannedSeries::messages() const { return impl_->messages; }

MaskedImage decode_view(const PlannedSeries& series, std::size_t view) {
  const ViewDecoder decoder(series);
  return in_fitted_frame(series, [&](Frames frames) { return decoder.decode(view, frames); });
}

}  // namespace tomofield::tilt_series
