#include <algorithm>
#include <cstdint>
#include <memory>

#include "base/aligned_buffer.h"
#include "base/enum_names.h"
#include "bench/cases.h"
#include "bench/projection_setup.h"
#include "field/field.h"
#include "field/sampling/resample.h"
#include "fit/domain.h"
#include "kernels/adam.h"
#include "kernels/lanes.h"
#include "kernels/leaf_decoding.h"
#include "kernels/total_variation.h"
#include "measurement/view_residuals.h"
#include "objective/constants.h"
#include "projection/slab_sampler.h"

namespace tomofield::bench {
namespace {

using kernels::kLanes;

constexpr int kThickness = 150;
constexpr int kBand = 2;  // a band away from the edges

FieldOptions field_options(FieldKind kind) {
  FieldOptions options;
  options.kind = kind;
  options.leaf_size = fit::usual_leaf_size(options);
  options.with_margin = false;
  return options;
}

// Holds everything that a step works on, with the buffers of one slab.
struct StepSetup {
  geometry::TiltGeometry geometry = yardstick_geometry(kThickness);
  fit::Domain domain;
  std::unique_ptr<field::Field> field;
  projection::SlabSampler sampler;
  int slab;
  std::vector<int> leaves;
  base::AlignedBuffer<float> values, samples, gradient, grad_samples, m, v, flux, above;

  explicit StepSetup(FieldKind kind)
      : domain(fit::make_domain(geometry, {0, 0, geometry.width, geometry.height},
                                field_options(kind))),
        field(fit::make_initial_field(domain, kThickness, 0.3, field_options(kind), 1)),
        sampler(*field, domain.grid, 0, geometry.height),
        slab(sampler.band(kBand).begin),
        values(domain.shapes[0].vertices_xz() * kLanes),
        samples(domain.grid.size()),
        gradient(field->num_parameters()),
        grad_samples(domain.grid.size()),
        m(field->num_parameters()),
        v(field->num_parameters()),
        flux(sampler.row_size()),
        above(sampler.row_size()) {
    for (const int leaf : sampler.leaves_of_band(kBand)) {
      const field::Square& square = field->tree().leaf(leaf).square;
      const std::int64_t row = static_cast<std::int64_t>(slab) * kLanes;
      if (square.y0 <= row && row < square.y1()) leaves.push_back(leaf);
    }
    sampler.decode(slab, samples.data());
    std::fill_n(grad_samples.data(), grad_samples.size(), 0.01f);
  }

  field::LaneRows rows(int leaf) const {
    std::array<double, kLanes> y{};
    for (int l = 0; l < kLanes; ++l) y[static_cast<std::size_t>(l)] = slab * kLanes + l + 0.5;
    return field->lane_rows(leaf, y);
  }
  double vertices() const {
    return static_cast<double>(domain.shapes[0].vertices_xz() * leaves.size() * kLanes);
  }
  double num_samples() const { return static_cast<double>(geometry.width) * kThickness * kLanes; }
};

// Holds the decoding of one leaf of the slab. The cases repeat it for every leaf of the slab.
struct LeafDecoding {
  std::vector<int> lower_x, lower_z;
  std::vector<float> fraction_x, fraction_z;
  kernels::LeafPiece piece;
  explicit LeafDecoding(const StepSetup& s) {
    const field::LeafShape& shape = s.field->shape(s.leaves[0]);
    const int size = static_cast<int>(s.geometry.width) / static_cast<int>(s.leaves.size());
    fill(size, shape.nx, lower_x, fraction_x);
    fill(kThickness, shape.nz, lower_z, fraction_z);
    piece = {.num_vertices_z = shape.nz,
             .x = {size, lower_x.data(), fraction_x.data()},
             .z = {kThickness, lower_z.data(), fraction_z.data()},
             .stride_z = s.domain.grid.segments()[0].stride_z(),
             .activation = s.field->activation};
  }

 private:
  static void fill(int count, int num_vertices, std::vector<int>& lower,
                   std::vector<float>& fraction) {
    for (int i = 0; i < count; ++i) {
      const field::AxisPoint at((i + 0.5) / count * (num_vertices - 1), num_vertices);
      lower.push_back(static_cast<int>(at.lower));
      fraction.push_back(static_cast<float>(at.fraction));
    }
  }
};

Case decode_case(const std::shared_ptr<StepSetup>& s, const std::shared_ptr<LeafDecoding>& d) {
  return {.name = "step: decode",
          .run =
              [s, d] {
                float* out = s->samples.data() + s->domain.grid.segments()[0].origin;
                for (std::size_t i = 0; i < s->leaves.size(); ++i, out += d->piece.x.count * kLanes)
                  kernels::decode_leaf(d->piece, s->values.data(), out);
              },
          .flops = 40 * s->num_samples(),
          .bytes = 4 * (2 * s->vertices() + s->num_samples())};
}

Case decode_adjoint_case(const std::shared_ptr<StepSetup>& s,
                         const std::shared_ptr<LeafDecoding>& d) {
  return {.name = "step: decode adjoint",
          .run =
              [s, d] {
                std::ptrdiff_t at = s->domain.grid.segments()[0].origin;
                for (std::size_t i = 0; i < s->leaves.size();
                     ++i, at += d->piece.x.count * kLanes) {
                  kernels::decode_leaf_adjoint(d->piece, s->samples.data() + at,
                                               s->grad_samples.data() + at, s->values.data());
                }
                s->values.fill(0.1f);
              },
          .flops = 25 * s->num_samples(),
          .bytes = 4 * (4 * s->vertices() + 2 * s->num_samples())};
}

Case variation_case(const std::shared_ptr<StepSetup>& s) {
  return {.name = "step: total variation",
          .run =
              [s] {
                const projection::SampleSegment& segment = s->domain.grid.segments()[0];
                kernels::SlabVariation v;
                v.samples = s->samples.data() + segment.origin;
                v.gradient = s->grad_samples.data() + segment.origin;
                v.nx = segment.nx;
                v.x = {0, segment.nx};
                v.nz = segment.nz;
                v.stride_z = segment.stride_z();
                v.num_rows = kLanes;
                v.above = {s->above.data(), segment.nz, 1};
                v.flux = s->flux.data();
                v.weight = 1e-6f;
                v.penalty = {static_cast<float>(objective::kGradientFloor),
                             static_cast<float>(objective::kConcavity)};
                kernels::slab_variation(v);
              },
          .flops = 35 * s->num_samples(),
          .bytes = 4 * 4 * s->num_samples()};
}

Case data_case(const std::shared_ptr<ProjectionSetup>& p) {
  struct Rays {
    base::AlignedBuffer<float> measured, predicted;
    std::vector<std::uint16_t> mask;
  };
  const auto width = p->geometry().width;
  const std::size_t size = p->views().size() * static_cast<std::size_t>(width) * kLanes;
  const auto rays = std::make_shared<Rays>();
  rays->measured.reset(size);
  rays->predicted.reset(size);
  rays->mask.assign(size / kLanes, 0xffff);
  return {.name = "step: data term",
          .run =
              [p, rays, width] {
                for (std::size_t v = 0; v < p->views().size(); ++v) {
                  const std::size_t at = v * static_cast<std::size_t>(width);
                  measurement::data_term({}, 8.0, rays->measured.data() + at * kLanes,
                                         rays->mask.data() + at, width,
                                         rays->predicted.data() + at * kLanes);
                }
              },
          .flops = 12.0 * static_cast<double>(size),
          .bytes = 12.0 * static_cast<double>(size)};
}

}  // namespace

std::vector<Case> step_cases() {
  const auto projection =
      std::make_shared<ProjectionSetup>(kThickness, FitOptions{}.subsets, kSlabsTogether);
  const auto step = std::make_shared<StepSetup>(FieldKind::kGrid);
  step->values.fill(0.1f);
  const auto decoding = std::make_shared<LeafDecoding>(*step);
  return {projection->forward_case(kStepForward, projection),
          projection->adjoint_case(kStepAdjoint, projection),
          data_case(projection),
          decode_case(step, decoding),
          decode_adjoint_case(step, decoding),
          variation_case(step)};
}

std::vector<Case> field_cases(FieldKind kind) {
  const auto s = std::make_shared<StepSetup>(kind);
  const field::LeafShape& shape = s->domain.shapes[0];
  // FMAs for each vertex and lane: VM contracts three ranks, a grid interpolates rows of vertices.
  const double fmas = kind == FieldKind::kVm
                          ? shape.rank_x + shape.rank_y + shape.rank_z
                          : 16.0 * (shape.ny - 1) / field_options(kind).leaf_size + 1;
  std::size_t parameters = 0;
  for (const int leaf : s->leaves)
    parameters += s->field->offset(leaf + 1) - s->field->offset(leaf);
  // All slabs that cross a leaf share its step of Adam.
  const double share = static_cast<double>(kLanes) / field_options(kind).leaf_size;
  const double stepped = share * static_cast<double>(parameters);
  const Case values{.name = base::name_of(kind) + std::string(": vertex values"),
                    .run =
                        [s] {
                          for (const int leaf : s->leaves)
                            s->field->slab_values(leaf, s->rows(leaf), s->values.data());
                        },
                    .flops = 2 * fmas * s->vertices(),
                    .bytes = 4 * (2 * s->vertices() + static_cast<double>(parameters))};
  const Case gradient{.name = base::name_of(kind) + std::string(": vertex gradient"),
                      .run =
                          [s] {
                            for (const int leaf : s->leaves) {
                              s->field->slab_gradient(leaf, s->rows(leaf), s->values.data(),
                                                      s->gradient.data() + s->field->offset(leaf));
                            }
                          },
                      .flops = (kind == FieldKind::kVm ? 4 : 2) * fmas * s->vertices(),
                      .bytes = 4 * (2 * s->vertices() + 3 * static_cast<double>(parameters))};
  const Case adam{.name = base::name_of(kind) + std::string(": Adam"),
                  .run =
                      [s, stepped] {
                        kernels::AdamStep step;
                        step.rate_m = 1e-6f;
                        const std::size_t first = s->field->offset(s->leaves[0]);
                        kernels::adam_step(step, static_cast<std::ptrdiff_t>(stepped),
                                           s->field->parameters().data() + first,
                                           s->gradient.data() + first, s->m.data() + first,
                                           s->v.data() + first);
                      },
                  .flops = 12 * stepped,
                  .bytes = 32 * stepped};
  return {values, gradient, adam};
}

}  // namespace tomofield::bench
