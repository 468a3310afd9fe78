#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "simulate/phantom.h"

namespace tomofield::simulate {

/// The sine and the cosine of the tilt of parallel rays. The ray through the pixel at (u, y) of the
/// aligned view has the points x = u cos θ − t sin θ, y, z = u sin θ + t cos θ.
struct Beam {
  explicit Beam(double tilt_deg)
      : cosine(std::cos(tilt_deg * std::numbers::pi / 180.0)),
        sine(std::sin(tilt_deg * std::numbers::pi / 180.0)) {}
  /// Returns u of the ray that meets a point of the specimen.
  double u_of(const std::array<double, 3>& point) const {
    return point[0] * cosine + point[2] * sine;
  }
  double cosine;
  double sine;
};

/// Returns exact line integrals through one ellipsoid. Let o be the point of the ray in the plane
/// through the body's centre that is nearest to the centre, and d the ray's direction. The ray
/// o + t d meets pᵀ Q p = s where A t² + 2 B t + E − s = 0, with A = dᵀQd, B = oᵀQd, E = oᵀQo. The
/// chord between these points is 2 √(B² − A (E − s)) / A.
class EllipsoidIntegral {
 public:
  EllipsoidIntegral(const Ellipsoid& body, const Beam& beam)
      : body_(body), beam_(beam), inner_(body.ratio * body.ratio) {
    const auto& q = body.q;
    const double c = beam.cosine, s = beam.sine;
    const double qd_x = -q[0] * s + q[4] * c, qd_z = -q[4] * s + q[2] * c;
    qd_y_ = -q[3] * s + q[5] * c;
    a_ = -s * qd_x + c * qd_z;
    b_per_u_ = c * qd_x + s * qd_z;
  }
  /// Returns the integral along the ray at (u, y) relative to the ray through the body's centre.
  double operator()(double u, double y) const {
    const double b = b_per_u_ * u + y * qd_y_;
    const double base = b * b - a_ * body_.form(u * beam_.cosine, y, u * beam_.sine);
    const double outer_chord = std::sqrt(std::max(base + a_, 0.0));
    const double inner_chord = std::sqrt(std::max(base + a_ * inner_, 0.0));
    return 2.0 / a_ *
           (body_.wall_density * outer_chord +
            (body_.inside_density - body_.wall_density) * inner_chord);
  }

 private:
  const Ellipsoid& body_;
  Beam beam_;
  double inner_ = 0.0, qd_y_ = 0.0, a_ = 0.0, b_per_u_ = 0.0;
};

/// Returns exact line integrals through one blob in a slab, divided by its Gaussian in the view. At
/// the distance t along a ray from the point nearest to the blob's centre, the blob has
/// exp(−t² / 2σ²) of its density in that point. The ray is within the slab for
/// |z| <= half_thickness.
class BlobIntegral {
 public:
  BlobIntegral(const Blob& blob, const Beam& beam, double half_thickness)
      : beam_(beam),
        half_thickness_(half_thickness),
        center_t_(-blob.center[0] * beam.sine + blob.center[2] * beam.cosine),
        unit_(std::numbers::sqrt2 * blob.sigma),
        factor_(blob.peak * blob.sigma * std::sqrt(std::numbers::pi / 2.0)) {}
  /// Returns the integral along the rays at u where the Gaussian in the view is 1.
  double operator()(double u) const {
    const double enter = (-half_thickness_ - u * beam_.sine) / beam_.cosine - center_t_;
    const double leave = (half_thickness_ - u * beam_.sine) / beam_.cosine - center_t_;
    return factor_ * (std::erf(leave / unit_) - std::erf(enter / unit_));
  }

 private:
  Beam beam_;
  double half_thickness_, center_t_, unit_, factor_;
};

/// Returns the line integral through the slab without its bodies and blobs.
double slab_integral(const Phantom& phantom, const Beam& beam, double u, double y);

}  // namespace tomofield::simulate
