#include "simulate/cryo/protein.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tomofield::simulate {
namespace {

// Pieces at this distance overlap to a density that varies by about a quarter.
constexpr double kPieceSpacing_A = 13.5;
constexpr double kPieceSigma_A = 0.4 * kPieceSpacing_A;
// Distance of neighbouring domains and radius to which a domain is filled, in its own radius.
constexpr double kDomainDistance = 1.65;
constexpr double kFilledRadius = 1.1;
// More candidates make rounder complexes.
constexpr int kCandidates = 12;

double distance(const Vector3& a, const Vector3& b) {
  const Vector3 d = moved(a, -1.0, b);
  return std::sqrt(dot(d, d));
}

// Grows the domains of one asymmetric unit.
class Assembly {
 public:
  Assembly(const ProteinKind& kind, base::Random& random)
      : kind_(kind),
        random_(random),
        spacing_(kDomainDistance * protein_radius_A(kind.domain_kDa)) {}

  std::vector<Vector3> grow(int num_domains) {
    while (std::ssize(domains_) < num_domains) domains_.push_back(best_place());
    return domains_;
  }

 private:
  // Returns the place nearest to the centre of some free ones.
  Vector3 best_place() {
    Vector3 best = free_place();
    for (int i = 1; i < kCandidates; ++i) {
      const Vector3 place = free_place();
      if (dot(place, place) < dot(best, best)) best = place;
    }
    return best;
  }

  // Returns a place that touches the assembly without overlapping it or its own copies.
  Vector3 free_place() {
    for (double reach = spacing_;; reach *= 1.01) {
      const Vector3 origin =
          domains_.empty() ? Vector3{} : domains_[random_.below(domains_.size())];
      const double step = domains_.empty() && kind_.copies() == 1 ? 0.0 : random_.uniform(1.0, 1.1);
      const Vector3 place = moved(origin, step * reach, random_direction(random_));
      if (is_free(place)) return place;
    }
  }

  bool is_free(const Vector3& place) const {
    for (int copy = 0; copy < kind_.copies(); ++copy) {
      const Vector3 other = symmetric_copy(kind_, copy, place);
      if (copy > 0 && distance(other, place) < spacing_) return false;
      for (const Vector3& domain : domains_)
        if (distance(other, domain) < 0.97 * spacing_) return false;
    }
    return true;
  }

  const ProteinKind& kind_;
  base::Random& random_;
  double spacing_;
  std::vector<Vector3> domains_;
};

// Tells whether a point belongs to the asymmetric unit: within one of its domains, and nearer to it
// than to a domain of another copy.
bool belongs(const ProteinKind& kind, std::span<const Vector3> domains, double radius,
             const Vector3& point) {
  const auto to_nearest = [&](const Vector3& p) {
    double nearest = 1e30;
    for (const Vector3& domain : domains) nearest = std::min(nearest, distance(p, domain));
    return nearest;
  };
  const double own = to_nearest(point);
  if (own > radius) return false;
  for (int copy = 1; copy < kind.copies(); ++copy)
    if (to_nearest(symmetric_copy(kind, copy, point)) < own) return false;
  return true;
}

// Returns pieces on a lattice with jitter, with relative weights.
std::vector<Gaussian> fill(const ProteinKind& kind, std::span<const Vector3> domains,
                           base::Random& random) {
  const double radius = kFilledRadius * protein_radius_A(kind.domain_kDa);
  double extent = radius;
  for (const Vector3& domain : domains)
    extent = std::max(extent, std::sqrt(dot(domain, domain)) + radius);
  const int half = static_cast<int>(std::ceil(extent / kPieceSpacing_A));
  std::vector<Gaussian> pieces;
  for (int z = -half; z <= half; ++z)
    for (int y = -half; y <= half; ++y)
      for (int x = -half; x <= half; ++x) {
        Vector3 point{static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)};
        for (double& c : point) c = kPieceSpacing_A * (c + random.uniform(-0.2, 0.2));
        const double weight = random.uniform(0.8, 1.2);
        if (belongs(kind, domains, radius, point)) pieces.push_back({point, kPieceSigma_A, weight});
      }
  return pieces;
}

}  // namespace

Vector3 symmetric_copy(const ProteinKind& kind, int copy, const Vector3& point) {
  const double angle = 2.0 * std::numbers::pi * (copy % kind.fold) / kind.fold;
  const double side = copy < kind.fold ? 1.0 : -1.0;
  const double c = std::cos(angle), s = std::sin(angle), y = side * point[1];
  return {c * point[0] - s * y, s * point[0] + c * y, side * point[2]};
}

std::vector<Gaussian> make_protein(const ProteinKind& kind, base::Random random) {
  const int num_domains =
      std::max(1, static_cast<int>(std::lround(kind.mass_kDa / (kind.copies() * kind.domain_kDa))));
  const std::vector<Vector3> domains = Assembly(kind, random).grow(num_domains);
  const std::vector<Gaussian> unit = fill(kind, domains, random);
  std::vector<Gaussian> complex;
  double weights = 0.0;
  for (int copy = 0; copy < kind.copies(); ++copy)
    for (const Gaussian& piece : unit) {
      complex.push_back(
          {symmetric_copy(kind, copy, piece.center_A), piece.sigma_A, piece.integral_VA3});
      weights += piece.integral_VA3;
    }
  for (Gaussian& piece : complex)
    piece.integral_VA3 *= kPotentialPerDalton_VA3 * 1e3 * kind.mass_kDa / weights;
  return complex;
}

double radius_A(std::span<const Gaussian> gaussians) {
  double squared = 0.0;
  for (const Gaussian& g : gaussians) squared = std::max(squared, dot(g.center_A, g.center_A));
  return std::sqrt(squared);
}

}  // namespace tomofield::simulate
