#include "compact/compress.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "base/threads/parallel.h"
#include "base/trace.h"
#include "compact/candidate_search.h"
#include "compact/decoded_field.h"
#include "compact/leaf_code.h"
#include "compact/place_tree.h"
#include "compact/price_search.h"
#include "compact/quantise.h"
#include "compact/structure.h"
#include "compact/truncation.h"
#include "compact/vertex_densities.h"
#include "tomofield/error.h"

namespace tomofield::compact {
namespace {

constexpr std::int64_t kLargestSide = 128;  // px
// The parts of the error that rounding may add; the ranks leave the rest. The first one makes the
// file small, and the second one the number of parameters (docs/results/compact.md).
constexpr double kRoundingForBytes = 0.3, kRoundingForParameters = 0.005;
// The least mean squared error of rounding, in variances. A budget that has room for all components
// leaves no error to share, and without rounding the whole numbers of a code would have no end.
constexpr double kLeastRounding = 1e-6;

// Relates decibels D of PSNR to a mean squared change, k D^p times the variance
// (docs/results/compact.md).
constexpr double kChangeOfDecibel = 0.032, kPowerOfDecibels = 0.7;

double allowed_change(double decibels) {
  return kChangeOfDecibel * std::pow(decibels, kPowerOfDecibels);
}
double decibels_of(double change) {
  return std::pow(change / kChangeOfDecibel, 1 / kPowerOfDecibels);
}

// Names the sum that a choice keeps within a limit: that of errors or that of costs.
struct Limit {
  bool of_error = true;
  double most = 0.0;
  double value(const Choice& choice) const { return of_error ? choice.error : choice.cost; }
};

// A part of the region of interest.
struct MeasuredRegion {
  double volume = 0.0, variance = 0.0;
};

bool is_in(const field::Square& square, base::Range rows) {
  return square.y0 < rows.end && square.y1() > rows.begin;
}

// Measures some rows of the region of interest.
MeasuredRegion measure(const VertexDensities& vertices, base::Range rows) {
  const field::Quadtree& tree = vertices.field().tree();
  std::vector<std::array<double, 3>> sums(static_cast<std::size_t>(tree.num_leaves()));
  base::parallel_for("measure densities", tree.num_leaves(), [&](std::int64_t i) {
    const field::QuadtreeNode& leaf = tree.leaf(static_cast<int>(i));
    if (vertices.is_outside(leaf.square) || !is_in(leaf.square, rows)) return;
    const PlaceDensities place = vertices.read(leaf.square);
    const auto [sum, square] = place.integrals();
    sums[static_cast<std::size_t>(i)] = {place.volume(), sum, square};
  });
  std::array<double, 3> all{};
  for (const auto& sum : sums) {
    for (std::size_t k = 0; k < all.size(); ++k) all[k] += sum[k];
  }
  // A field without any contrast has a variance as well, which is above the errors of floats.
  constexpr double kSmallest = 1e-12, kSmallestPart = 1e-9;
  const double mean = all[1] / all[0], mean_square = all[2] / all[0];
  return {all[0], std::max({kSmallest, kSmallestPart * mean_square, mean_square - mean * mean})};
}

class Compression {
 public:
  // A change in decibels counts against `variance`, or that of the rows if it is 0.
  Compression(const field::Field& vertices, const Rectangle& roi, base::Range rows,
              std::int64_t largest_side, double variance)
      : vertices_(vertices, roi),
        rows_(rows),
        squares_(place_squares(vertices_, largest_side, rows)),
        candidates_(vertices_, squares_),
        region_(measure(vertices_, rows)) {
    if (variance > 0) region_.variance = variance;
  }
  Compression(const Compression&) = delete;  // its members refer to each other
  Compression& operator=(const Compression&) = delete;

  double variance() const { return region_.variance; }
  double volume() const { return region_.volume; }  // of the region of interest

  // Finds ranks at prices around the one that meets the limit, and chooses among them.
  void choose(const Limit& limit) {
    constexpr int kRounds = 8;
    constexpr double kClose = 0.005, kFar = 1e-3;
    PriceSearch search(last_price_ > 0 ? last_price_ : surveyed_price(limit), limit.of_error);
    for (int round = 0; round < kRounds; ++round) {
      last_price_ = search.price();
      candidates_.add(last_price_);
      const Choice cheapest = cheapest_choice(candidates_.places(), last_price_);
      const double ratio = std::clamp(limit.value(cheapest) / limit.most, kFar, 1 / kFar);
      candidates_.keep_near(cheapest, last_price_);
      if (std::abs(ratio - 1) < kClose) break;
      search.go_on(ratio);
    }
    choice_ = limit.of_error ? choose_within_error(candidates_.places(), limit.most)
                             : choose_within_cost(candidates_.places(), limit.most);
    truncate_chosen();
  }

  const Choice& choice() const { return choice_; }

  // Returns the squared error of what was chosen with its factors rounded as code() rounds them,
  // before faces are softened. It takes a fraction of the time of code() and finish().
  double rounded_error(double rounding_error) const {
    const double step = step_of(rounding_error);
    std::vector<double> errors(leaves_.size());
    base::parallel_for("round leaves", std::ssize(leaves_), [&](std::int64_t i) {
      const auto at = static_cast<std::size_t>(i);
      if (squares_.leaf_like[place_of_leaf_[at]] < 0) return;
      const PlaceDensities place = vertices_.read(tree_.leaf(static_cast<int>(i)).square);
      const QuantisedLeaf rounded = quantise(leaves_[at], place.nx, place.ny, place.nz, step);
      const FloatMatrix values =
          values_of(dequantised_modes(rounded, step), place.nx, place.ny, place.nz);
      errors[at] = (values - place.values).cast<double>().squaredNorm() * place.volume_of_vertex;
    });
    return std::accumulate(errors.begin(), errors.end(), 0.0);
  }

  // Rounds the factors of what was chosen, so that rounding alone adds this error, and codes them.
  // Faces are not softened yet.
  CodedField code(double rounding_error) const {
    CodedField coded{.tree = tree_, .thickness = vertices_.field().thickness(), .codes = {}};
    LeafCodes& codes = coded.codes;
    const double step = step_of(rounding_error);
    const auto num_bands = static_cast<std::size_t>(tree_.roots().rows);
    codes.step.assign(num_bands, step);
    codes.face_weight.assign(num_bands, 0.0);
    codes.shapes.assign(leaves_.size(), kNoLeaf);
    std::vector<std::vector<std::uint8_t>> code(leaves_.size());
    base::parallel_for("code leaves", std::ssize(leaves_), [&](std::int64_t i) {
      const auto at = static_cast<std::size_t>(i);
      if (squares_.leaf_like[place_of_leaf_[at]] < 0) return;
      const PlaceDensities place = vertices_.read(tree_.leaf(static_cast<int>(i)).square);
      const QuantisedLeaf rounded = quantise(leaves_[at], place.nx, place.ny, place.nz, step);
      codes.shapes[at] = rounded.shape;
      code[at] = encode(rounded);
    });
    codes.offset.push_back(0);
    for (const auto& of_leaf : code) {
      codes.bytes.insert(codes.bytes.end(), of_leaf.begin(), of_leaf.end());
      codes.offset.push_back(std::ssize(codes.bytes));
    }
    return coded;
  }

  // Softens the faces of coded leaves, and measures what they stand for. One decoded field is in
  // memory at a time.
  CompactField finish(CodedField coded) const {
    CompactField made{.coded = std::move(coded), .field = nullptr, .report = {}};
    LeafCodes& codes = made.coded.codes;
    const double weight =
        matching_face_weight(*decode_field(made.coded), codes, vertices_.field(), vertices_.roi());
    codes.face_weight.assign(codes.face_weight.size(), weight);
    made.field = decode_field(made.coded);
    made.report = {.parameters = codes.num_parameters(),
                   .bytes = codes.bytes.size(),
                   .mean_square_change = square_change(*made.field) / volume(),
                   .variance = variance(),
                   .volume = volume()};
    made.report.decibels = decibels_of(made.report.mean_square_change / variance());
    return made;
  }

 private:
  // Estimates the price at which the z mode alone would meet a limit, from some leaves.
  double surveyed_price(const Limit& limit) const {
    constexpr int kMostLeaves = 48;
    const field::Quadtree& tree = vertices_.field().tree();
    std::vector<field::Square> leaves;
    for (int leaf = 0; leaf < tree.num_leaves(); ++leaf) {
      const field::Square& square = tree.leaf(leaf).square;
      if (is_in(square, rows_) && !vertices_.is_outside(square)) leaves.push_back(square);
    }
    const std::size_t stride = std::max<std::size_t>(1, leaves.size() / kMostLeaves);
    struct Component {
      double energy, cost;
    };
    std::vector<std::vector<Component>> found((leaves.size() + stride - 1) / stride);
    std::vector<double> volumes(found.size());
    base::parallel_for("survey leaves", std::ssize(found), [&](std::int64_t i) {
      const PlaceDensities place = vertices_.read(leaves[static_cast<std::size_t>(i) * stride]);
      volumes[static_cast<std::size_t>(i)] = place.volume();
      const double cost = static_cast<double>(place.nz) + static_cast<double>(place.nx) * place.ny;
      for (const float energy : energies_of_sections(place))
        found[static_cast<std::size_t>(i)].push_back(
            {static_cast<double>(energy) * place.volume_of_vertex, cost});
    });
    std::vector<Component> all;
    double volume = 0, error = 0, cost = 0;
    for (std::size_t i = 0; i < found.size(); ++i) {
      all.insert(all.end(), found[i].begin(), found[i].end());
      volume += volumes[i];
    }
    for (const Component& component : all) error += component.energy;
    std::ranges::sort(all, [](const Component& a, const Component& b) {
      return a.energy * b.cost > b.energy * a.cost;
    });
    const double most = limit.most * volume / region_.volume;
    double price = 1e-30;
    for (const Component& component : all) {
      if (limit.of_error ? error <= most : cost >= most) break;
      error -= component.energy;
      cost += component.cost;
      price = component.energy / component.cost;
    }
    return std::max(price, 1e-30);
  }

  // Returns the squared difference of a compact field from the vertices, times volume.
  double square_change(const field::Field& made) const {
    std::vector<double> errors(static_cast<std::size_t>(made.tree().num_leaves()));
    base::parallel_for("measure the change", std::ssize(errors), [&](std::int64_t i) {
      const int leaf = static_cast<int>(i);
      const field::Square& square = made.tree().leaf(leaf).square;
      if (vertices_.is_outside(square)) return;
      const PlaceDensities place = vertices_.read(square);
      const field::LeafShape& s = made.shape(leaf);
      const float* value = made.parameters().data() + made.offset(leaf);
      double sum = 0;
      for (int x = 0; x < place.nx; ++x) {
        for (int z = 0; z < place.nz; ++z, value += s.ny) {
          for (int y = 0; y < place.ny; ++y)
            sum += std::pow(
                static_cast<double>(value[y] - place.values(x, Eigen::Index{z} * place.ny + y)), 2);
        }
      }
      errors[static_cast<std::size_t>(i)] = sum * place.volume_of_vertex;
    });
    return std::accumulate(errors.begin(), errors.end(), 0.0);
  }

  double step_of(double rounding_error) const {
    const double least = kLeastRounding * variance() * volume();
    return error_of_step_ > 0.0 ? std::sqrt(std::max(rounding_error, least) / error_of_step_) : 0.0;
  }

  // Finds the factors of the places that are chosen.
  void truncate_chosen() {
    tree_ = chosen_tree(squares_, choice_, place_of_leaf_);
    leaves_.assign(place_of_leaf_.size(), {});
    std::vector<double> errors(leaves_.size());
    base::parallel_for("truncate leaves", std::ssize(leaves_), [&](std::int64_t i) {
      const auto at = static_cast<std::size_t>(i);
      const std::size_t place = place_of_leaf_[at];
      if (squares_.leaf_like[place] < 0) return;
      const PlaceDensities densities = vertices_.read(squares_.nodes[place].square);
      const double price = candidates_.price_of(place, choice_.candidate[place]);
      leaves_[at] = truncate(densities, price / densities.volume_of_vertex);
      // Rounding errors are uniform: their mean square is a twelfth of the step's.
      errors[at] =
          densities.volume_of_vertex / 12 * static_cast<double>(leaves_[at].num_parameters());
    });
    error_of_step_ = std::accumulate(errors.begin(), errors.end(), 0.0);
  }

  VertexDensities vertices_;
  base::Range rows_;
  PlaceSquares squares_;
  CandidateSearch candidates_;
  MeasuredRegion region_;
  Choice choice_;
  field::Quadtree tree_;                    // of what was chosen
  std::vector<std::size_t> place_of_leaf_;  // of this tree
  std::vector<Truncation> leaves_;          // of this tree
  double error_of_step_ = 0.0;              // of rounding these leaves to steps of 1
  double last_price_ = 0.0;
};

// Rounding adds less than uniform errors would where components vanish, and more where vectors are
// short, so the step is corrected once it was tried.
CompactField within_decibels(Compression& compression, double decibels) {
  constexpr int kTries = 5, kModels = 8;
  constexpr double kMost = 0.98, kLeast = 0.96;  // softened faces have a slightly larger error
  const double change = allowed_change(decibels) * compression.variance() * compression.volume();
  compression.choose({.of_error = true, .most = (1 - kRoundingForBytes) * change});
  const double left = std::max(change - compression.choice().error, 0.01 * change);
  double rounding = left;
  for (int i = 0; i < kTries; ++i) {
    const double added = compression.rounded_error(rounding) - compression.choice().error;
    if (added <= kMost * left && added > kLeast * left) break;
    rounding *= (kLeast + kMost) / 2 * left / std::max(added, 0.1 * left);
  }
  CompactField made = compression.finish(compression.code(rounding));
  for (int i = 1; i < kModels && made.report.decibels > decibels; ++i) {
    const double excess = made.report.mean_square_change * compression.volume() - change;
    rounding = std::clamp(rounding - excess, rounding / 2, kLeast * rounding);
    made = {};  // memory is for one model
    made = compression.finish(compression.code(rounding));
  }
  return made;
}

// Returns the codes of at most `parameters` parameters, if there are any.
CodedField coded_parameters(Compression& compression, double parameters, double part_of_rounding) {
  compression.choose({.of_error = false, .most = parameters});
  return compression.code(compression.choice().error * part_of_rounding / (1 - part_of_rounding));
}

CompactField within_parameters(Compression& compression, double parameters) {
  CodedField coded = coded_parameters(compression, parameters, kRoundingForParameters);
  if (static_cast<double>(coded.codes.num_parameters()) > parameters)
    throw Error(
        fmt::format("no model of {:.0f} parameters was found: give a larger budget", parameters));
  return compression.finish(std::move(coded));
}

// Returns the bytes of a file beside the codes: the tree, the shapes of leaves, and the options.
double bytes_beside_codes(const CodedField& coded, const FileSize& file_size) {
  const std::size_t of_codes = coded.codes.bytes.size();
  return file_size ? static_cast<double>(file_size(coded)) - static_cast<double>(of_codes) : 0.0;
}

// Looks for the largest number of parameters whose file is within a size. The bytes that a
// parameter takes are known once a model was coded.
class ParameterSearch {
 public:
  explicit ParameterSearch(double bytes) : bytes_(bytes), parameters_(bytes / kFirstBytes) {}

  double parameters() const { return parameters_; }

  // Chooses the next number after a model of `of_codes` bytes of codes and `beside` other bytes.
  // Returns false if the model is as close to the size as wanted.
  bool go_on(double of_codes, double beside) {
    const double part = beside < bytes_ ? of_codes / (bytes_ - beside) : kFar;
    if (part <= 1 && part > kClose) return false;
    (part <= 1 ? low_ : high_) = parameters_;
    parameters_ *= (1 + kClose) / 2 / std::clamp(part, 1 / kFar, kFar);
    if (low_ > 0 && high_ > 0 && (parameters_ <= low_ || parameters_ >= high_))
      parameters_ = std::sqrt(low_ * high_);
    return true;
  }

 private:
  static constexpr double kFirstBytes = 0.45, kClose = 0.95, kFar = 10;
  double bytes_, parameters_;
  double low_ = 0.0, high_ = 0.0;  // parameters whose files are within the size and above it, or 0
};

// Keeps the largest model that is within the budget.
CompactField within_bytes(Compression& compression, double bytes, const FileSize& file_size) {
  constexpr int kTries = 8;
  ParameterSearch search(bytes);
  double least_beside = std::numeric_limits<double>::infinity();
  std::optional<CodedField> best;
  bool goes_on = true;
  for (int i = 0; i < kTries && goes_on; ++i) {
    CodedField coded = coded_parameters(compression, search.parameters(), kRoundingForBytes);
    const double beside = bytes_beside_codes(coded, file_size);
    const auto of_codes = static_cast<double>(coded.codes.bytes.size());
    least_beside = std::min(least_beside, beside);
    if (of_codes + beside <= bytes &&
        (!best || coded.codes.bytes.size() >= best->codes.bytes.size()))
      best = std::move(coded);
    goes_on = search.go_on(of_codes, beside);
  }
  if (!best)
    throw Error(
        fmt::format("no model of {:.0f} bytes was found, whose tree and options alone take {:.0f}: "
                    "give a larger budget",
                    bytes, least_beside));
  return compression.finish(std::move(*best));
}

CompactField within(const Budget& budget, Compression& compression, const FileSize& file_size) {
  switch (budget.kind) {
    case Budget::Kind::kDecibels:
      return within_decibels(compression, budget.amount);
    case Budget::Kind::kParameters:
      return within_parameters(compression, budget.amount);
    case Budget::Kind::kBytes:
      break;
  }
  return within_bytes(compression, budget.amount, file_size);
}

}  // namespace

void require_likeness(const CompressionReport& report) {
  if (!(report.decibels > kMostDecibels)) return;
  throw Error(
      fmt::format("a model of {} parameters would be another tomogram (the PSNR falls by "
                  "{:.0f} dB): give a larger budget",
                  report.parameters, report.decibels));
}

CompressionReport joined(const CompressionReport& a, const CompressionReport& b) {
  CompressionReport both{
      .parameters = a.parameters + b.parameters,
      .bytes = a.bytes + b.bytes,
      .mean_square_change = a.mean_square_change * a.volume + b.mean_square_change * b.volume,
      .variance = a.variance * a.volume + b.variance * b.volume,
      .volume = a.volume + b.volume};
  both.mean_square_change /= both.volume;
  both.variance /= both.volume;
  both.decibels = decibels_of(both.mean_square_change / both.variance);
  return both;
}

double variance_of(const field::Field& vertices, const Rectangle& roi) {
  return measure(VertexDensities(vertices, roi), rows_of(vertices)).variance;
}

CompactField compress(const field::Field& vertices, const Rectangle& roi, const Budget& budget,
                      const FileSize& file_size) {
  const base::TraceSpan span("compress");
  Compression compression(vertices, roi, rows_of(vertices), kLargestSide, 0.0);
  CompactField made = within(budget, compression, file_size);
  require_likeness(made.report);
  return made;
}

CompactField compress(const field::Field& vertices, const Rectangle& roi, const Budget& budget,
                      base::Range rows, double variance, const FileSize& file_size) {
  const base::TraceSpan span("compress");
  Compression compression(vertices, roi, rows, vertices.tree().roots().cell_size, variance);
  return within(budget, compression, file_size);
}

}  // namespace tomofield::compact
