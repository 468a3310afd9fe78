#include "report/run_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "base/trace.h"
#include "base/version.h"
#include "io/images/mrc.h"
#include "measurement/view_transfers.h"
#include "report/alignment_plot.h"
#include "report/embedded_volume.h"
#include "report/html.h"
#include "report/reduced_volume.h"
#include "report/reported_options.h"
#include "report/run_plots.h"
#include "tomofield/version.h"
#include "verdict/verdict.h"

namespace tomofield::report {
namespace {

std::string size_text(const std::array<std::int64_t, 3>& size) {
  return fmt::format("{} × {} × {}", size[0], size[1], size[2]);
}

std::string time_text(double seconds) {
  if (seconds < 100) return fmt::format("{:.1f} s", seconds);
  if (seconds < 6000) return fmt::format("{:.0f} min", seconds / 60);
  return fmt::format("{:.1f} h", seconds / 3600);
}

// Returns each fit: that of all data, and those of the halves, if the run made some.
AllFits fits_of(const record::RunRecord& record) {
  if (!record.halves) return {{"", record.fit}};
  const auto& [even, odd] = record.halves->halves;
  return {{"all data", record.fit}, {"even half", even.fit}, {"odd half", odd.fit}};
}

void add_verdict(const verdict::Verdict& verdict, HtmlPage& page) {
  std::vector<std::string> texts;
  for (const verdict::Warning& warning : verdict.warnings) {
    std::string text = warning.message;
    if (!text.empty()) text.front() = static_cast<char>(std::toupper(text.front()));
    texts.push_back(text + ".");
  }
  if (texts.empty()) {
    const char* const checked =
        verdict.views ? "Contrast, order of the tilts, alignment, tilt axis, thickness, noise and "
                        "residual were checked"
                      : "The thickness was checked, which is all that --engine ray allows";
    page.add_notice("No warning",
                    {fmt::format("{}, and nothing seems off. No check can see a wrong hand, or a "
                                 "thickness that is a little too small.",
                                 checked)},
                    false);
    return;
  }
  page.add_notice(texts.size() == 1 ? "One warning" : fmt::format("{} warnings", texts.size()),
                  texts, true);
}

std::vector<HtmlFact> facts_of_size(const record::FitMetrics& metrics,
                                    const EmbeddedVolume& volume) {
  const auto [lowest, highest] =
      std::ranges::minmax(metrics.views, {}, &record::ViewMetrics::tilt_deg);
  const auto& size = volume.file_size;
  std::vector<HtmlFact> facts{
      {"Tomogram", size_text(size), "Voxels along x, y and z of the file."}};
  if (volume.voxel_size_A > 0) {
    const auto nm = [&](std::size_t axis) {
      return static_cast<double>(size[axis]) * volume.voxel_size_A / 10;
    };
    facts.push_back(
        {"Voxel", fmt::format("{:.4g} Å", volume.voxel_size_A),
         fmt::format("The tomogram has {:.4g} × {:.4g} × {:.4g} nm.", nm(0), nm(1), nm(2))});
  }
  facts.push_back(
      {"Views", fmt::format("{}", metrics.views.size()),
       fmt::format("Tilts from {:.1f}° to {:.1f}°.", lowest.tilt_deg, highest.tilt_deg)});
  return facts;
}

// Adds how far gold beads lie from their places, if an alignment followed some.
void add_beads(const alignment::AlignmentRecord& alignment, std::vector<HtmlFact>& facts) {
  if (!alignment.beads) return;
  const alignment::BeadRecord& beads = *alignment.beads;
  const double new_px = beads.is_accepted ? beads.after_px : beads.before_px;
  const bool is_new = alignment.is_accepted;
  facts.push_back(
      {"Gold beads", fmt::format("{:.2f} px", is_new ? new_px : beads.files_px),
       fmt::format("{} beads lie so far from their places (root mean square in x and y). With the "
                   "alignment {}: {:.2f} px.",
                   beads.num_beads, is_new ? "of the files" : "that was tried and not taken",
                   is_new ? beads.files_px : new_px)});
}

// Adds what an alignment found of the specimen's pose.
void add_pose(const alignment::AlignmentRecord& alignment, std::vector<HtmlFact>& facts) {
  if (!alignment.pose) return;
  const auto& [pose, error] = *alignment.pose;
  facts.push_back(
      {"Thickness and pitch",
       fmt::format("{:.0f} ± {:.0f} px, {:.1f} ± {:.1f}°, {:.1f} ± {:.1f}°", pose.thickness_px,
                   error.thickness_px, pose.pitch_deg, error.pitch_deg, pose.x_tilt_deg,
                   error.x_tilt_deg),
       "What the specimen seems to have: its thickness in unbinned pixels, and its angles in "
       "degrees "
       "against the tilt angles and about X. "
       "Noisy views give rough values, whatever their errors say: look at the XZ plane first. The "
       "alignment applied none of them; --thickness and tomofield export --level found do that."});
}

void add_prior(const verdict::PriorSummary& prior, std::vector<HtmlFact>& facts) {
  if (!prior.is_used && !prior.gain) return;
  std::string note =
      "A network that was trained on simulated series suggested what is shown, and the views "
      "corrected it. ";
  if (!prior.is_used) note = "A trial with the learned prior predicted held-out views worse. ";
  if (prior.gain)
    note += fmt::format("Error of held-out views with it, in trials: {:+.2f} % ± {:.2f}.",
                        -100 * prior.gain->log_ratio, 100 * prior.gain->standard_error);
  facts.push_back({"Learned prior", prior.is_used ? "yes" : "no", note});
}

void add_held_out(const verdict::HeldOutSummary& held_out, std::vector<HtmlFact>& facts) {
  facts.push_back(
      {held_out.is_of_trials ? "Held-out views, in trials" : "Held-out views",
       fmt::format("{:.2f}", held_out.median),
       fmt::format("The same of views that were not fitted (median): near the residual if the "
                   "tomogram has no structure that only the fitted views want. Worst {:.2f} at "
                   "{:.1f}°.",
                   held_out.worst, held_out.worst_tilt_deg)});
}

std::vector<HtmlFact> facts_of_fit(const record::FitRecord& fit) {
  const verdict::Verdict& verdict = fit.verdict;
  std::vector<HtmlFact> facts;
  facts.push_back({"Residual", fmt::format("{:.2f}", verdict.residual),
                   "What the tomogram leaves of the views, over the noise's variance: about 1 if "
                   "nothing but noise is left, more if it cannot explain the views."});
  if (verdict.held_out) add_held_out(*verdict.held_out, facts);
  add_prior(verdict.prior, facts);
  if (verdict.views)
    facts.push_back({"Alignment", fmt::format("{:.2g} px", verdict.views->usual_displacement_px()),
                     "9 of 10 views lie closer than this to where the tomogram predicts them."});
  if (fit.alignment) {
    add_beads(*fit.alignment, facts);
    add_pose(*fit.alignment, facts);
  }
  if (const auto& speckle = verdict.artefacts.speckle; speckle && std::isfinite(*speckle))
    facts.push_back(
        {"Speckle", fmt::format("{:.3f} %", 100 * *speckle),
         "Voxels that stick out from all their neighbours: grains of noise, or detail as small as "
         "a voxel. A warning says where they are noise."});
  facts.push_back({"Masked", fmt::format("{:.1f} %", 100 * fit.metrics.mask.mean_part()),
                   "Pixels of the views that did not count: beads, fill, bad pixels."});
  facts.push_back({"Time and memory",
                   fmt::format("{}, {:.2g} GiB", time_text(verdict.seconds), verdict.peak_GiB),
                   fmt::format("Threads: {}.", fit.metrics.threads)});
  return facts;
}

void add_volume(VolumeAxes axes, const EmbeddedVolume& volume, HtmlPage& page) {
  page.add_heading("The tomogram");
  page.add_paragraph(
      "Turn the wheel over a plane to scroll through it (with Ctrl: to zoom), click to move the "
      "other two planes there, drag to pan. Arrow keys, + and − work on the plane that was "
      "clicked.");
  page.add_volume(volume);
  std::string text = fmt::format(
      "8-bit copy for this page, {} voxels{}; values below {:.4g} and above {:.4g} are clipped.",
      size_text(volume.size),
      volume.size == volume.file_size ? "" : " (each the mean of the file's voxels that it covers)",
      volume.limits.first, volume.limits.second);
  if (axes == VolumeAxes::kXzy)
    text += " Planes are named after the axes of the file, whose y is the specimen's thickness.";
  page.add_paragraph(
      text + " The command tomofield view shows the file itself, and the model at any zoom.");
}

std::vector<HtmlCell> option_cells(const ReportedOption& option) {
  return {{option.flag, ""},
          {option.value, option.is_default ? "" : "given"},
          {option.origin, ""},
          {option.meaning, ""}};
}

// Returns an option with the diameter of the beads that were masked, if nobody gave it.
ReportedOption with_found_beads(ReportedOption option, const tilt_series::MaskMetrics& masks) {
  const bool is_found = option.flag == "--bead-diameter" && option.is_default &&
                        masks.bead_masking == tilt_series::BeadMasking::kMasked;
  if (!is_found) return option;
  option.value = fmt::format("{:.3g} nm", masks.bead_diameter_A / 10);
  option.origin = "found in the views";
  option.is_default = false;
  return option;
}

// Says whether the views of a dark series were fitted without a contrast transfer.
bool lacks_transfer(const SeriesFiles& files, const ViewOptions& views) {
  return views.contrast == tomofield::Contrast::kDark && !measurement::has_ctf_file(files) &&
         !views.defocus_um;
}

void add_input(const ReportSource& source, HtmlPage& page) {
  page.add_heading("What went in, and what was assumed");
  if (lacks_transfer(source.files, source.options.views))
    page.add_paragraph(
        "CTF and dose: the views are taken as plain projections of the specimen, because no "
        "contrast transfer was given (--ctf or --defocus). So fringes of defocus stay in the "
        "tomogram. What was corrected in the stack before stays corrected.");
  using Rows = std::vector<std::vector<HtmlCell>>;
  Rows chosen{{{"option", ""}, {"value", ""}, {"from", ""}, {"meaning", ""}}}, defaults = chosen;
  const tilt_series::MaskMetrics& masks = source.record.fit.metrics.mask.masks;
  for (const ReportedOption& reported : reported_options(source.files, source.options)) {
    const ReportedOption option = with_found_beads(reported, masks);
    (option.is_default ? defaults : chosen).push_back(option_cells(option));
  }
  page.add_table(chosen, TableOf::kWords);
  page.begin_folded(fmt::format("{} options have their defaults", defaults.size() - 1));
  page.add_table(defaults, TableOf::kWords);
  page.end_folded();
}

std::string mask_text(const output::MaskedViews& masked) {
  const tilt_series::MaskMetrics& masks = masked.masks;
  std::string text = "Pixels in red did not count in the fit. ";
  if (masks.num_beads == 0)
    text += "No beads were found";
  else if (masks.bead_masking == tilt_series::BeadMasking::kMasked)
    text += fmt::format("{} were found and masked", describe_beads(masks));
  else
    text += fmt::format("{} were found and kept (blue), because no trial without them was as good",
                        describe_beads(masks));
  return text + fmt::format("; {} hot or dead pixels; {:.1f} % of all pixels are masked.",
                            masks.num_bad_pixels, 100 * masked.mean_part());
}

void add_pictures(const ReportSource& source, const AllFits& fits, HtmlPage& page) {
  const record::FitMetrics& metrics = fits.front().metrics();
  page.add_heading("Masks");
  page.add_paragraph(mask_text(metrics.mask));
  page.add_figures({{source.pictures.mask, "The view of lowest tilt"}}, FigureSize::kLarge);
  if (const base::Html plot = masked_plot(fits); !plot.empty()) page.add_svg(plot);
  if (!source.pictures.tree) return;
  page.add_heading("Tree");
  page.add_paragraph(
      "Leaves of the adaptive tree over the central XY plane. They are small where the density "
      "varies much.");
  page.add_figures({{*source.pictures.tree, fmt::format("{} leaves", metrics.num_leaves)}},
                   FigureSize::kLarge);
}

// Adds a plot with its heading and explanation, if there is one.
void add_plot(const char* heading, const char* text, const base::Html& svg, HtmlPage& page) {
  if (svg.empty()) return;
  page.add_heading(heading);
  page.add_svg(svg, text);
}

// Adds what the alignment before the fit found.
void add_alignment(const alignment::AlignmentRecord& record, HtmlPage& page) {
  page.add_heading("Views: alignment before the fit");
  page.add_paragraph(fmt::format(
      "The views were aligned with the projections of a field that was fitted to all of them. "
      "Views that such a field did not see are predicted with an error of {:.4f} of their "
      "variance; with the alignment of the files it is {:.4f}. {}",
      record.held_out.after, record.held_out.before,
      record.is_accepted ? "So the new alignment is used."
                         : "So the alignment of the files is kept."));
  for (const CurvePlot& plot : alignment_plots(alignment_curves(record)))
    page.add_svg(curve_plot_svg(plot.axes, plot.curves), "");
}

// Says why no section shows what another place of the dial would do.
const char* why_no_dial(const FitOptions& fit) {
  if (!fit.penalty.is_left_to_trials())
    return "No sections show what --denoise would do: the weight of total variation was given to "
           "this run (by --tv, --tv-penalty, or a batch that chose once for all its series), so it "
           "tried no others.";
  return "No sections show what --denoise would do: this run has no trials with three weights near "
         "half of the chosen one, the chosen one, and twice it.";
}

// Shows what another place of the dial would do.
void add_dial(const ReportSource& source, HtmlPage& page) {
  page.add_heading("Lighter or stronger denoising");
  if (!source.pictures.dial) return page.add_paragraph(why_no_dial(source.options.fit));
  page.add_paragraph(fmt::format(
      "The same section from three short fits. This run was made with --denoise {}. Where the "
      "strong one loses what you want to see, give --denoise light; where the medium one is too "
      "grainy, give --denoise strong, or any factor such as 1.5. The whole fit is a little "
      "smoother than these.",
      source.options.fit.denoise));
  page.add_figures({{*source.pictures.dial,
                     "The trials whose weights are nearest to half of the chosen one, to the "
                     "chosen one, and to twice it. --denoise takes the factors"}},
                   FigureSize::kLarge);
}

// Shows what the learned prior changes, if trials have compared it.
void add_prior_picture(const ReportSource& source, HtmlPage& page) {
  if (!source.pictures.prior) return;
  const bool is_used = source.options.fit.prior == Prior::kLearned;
  page.add_heading("The learned prior");
  page.add_paragraph(fmt::format(
      "The same section from two fits of some rows, without some views. {} (docs/prior.md).",
      is_used
          ? "With the prior the views left out were not predicted clearly worse, so it ended this "
            "fit. "
            "Look whether you trust what it adds; --prior tv does without"
          : "With the prior the views left out were predicted worse, so this fit does without"));
  page.add_figures({{*source.pictures.prior,
                     "Without the prior, with it, and the difference in the same greys"}},
                   FigureSize::kLarge);
}

void add_fit(const ReportSource& source, const AllFits& fits, HtmlPage& page) {
  add_plot(
      "Settings that trials chose",
      "Short fits without some views were tried before the fit. Lower is better, and the chosen "
      "settings are at 0; bars are two standard errors long. Errors are compared patch by patch of "
      "these views (the median over pairs of patches). The weight lies between those that were "
      "tried, and a concave penalty is taken only if it is surely better (docs/fitting.md).",
      trials_plot(source.record.fit.tuned), page);
  add_dial(source, page);
  add_prior_picture(source, page);
  if (source.record.fit.alignment) add_alignment(*source.record.fit.alignment, page);
  add_plot("Loss",
           "The fit begins with coarse pixels, whose noise is lower; the curves jump where it goes "
           "on with finer ones. Held-out views that get worse while the fitted ones improve would "
           "say that noise is fitted.",
           loss_plot(fits), page);
  add_plot("Views: residual",
           "A view far above its neighbours is damaged, badly aligned or has another tilt than its "
           "file says: look at it, and leave it out with --exclude if it is.",
           residual_plot(fits), page);
  if (source.pictures.held_out) {
    page.add_paragraph(
        "A view that was held out: measured, predicted by the tomogram, and the difference, which "
        "should look like noise.");
    page.add_figures({{*source.pictures.held_out, "Measured, predicted, measured − predicted"}},
                     FigureSize::kLarge);
  }
}

void add_views(const AllFits& fits, HtmlPage& page) {
  add_plot("Views: scale and weight",
           "The scale is the view's brightness in comparison with the tomogram (1 if it is not "
           "fitted: --view-scale). Views that the tomogram explains less well than their noise "
           "allows have a weight below 1.",
           scale_plot(fits), page);
  add_plot("Views: offset and noise",
           "The offset is what is added to a predicted view. The noise is measured on each view "
           "before the fit.",
           offset_plot(fits), page);
  add_plot(
      "Views: alignment",
      "How far measured views lie from where the tomogram predicts them. A trend along the tilt "
      "or a view far from 0 speaks for a better alignment.",
      displacement_plot(fits), page);
}

void add_halves(const record::HalvesRecord& halves, HtmlPage& page) {
  add_plot("Halves",
           "Fourier shell correlation of two fits to halves of the data. Both fits prefer smooth "
           "volumes in the same way, so the curve says more about what they share than about the "
           "resolution of the specimen.",
           halves_plot(halves.fsc.fsc), page);
}

void add_costs(const record::FitRecord& fit, HtmlPage& page) {
  const record::FitMetrics& metrics = fit.metrics;
  const verdict::Verdict& verdict = fit.verdict;
  page.add_heading("Time and memory");
  page.add_paragraph(fmt::format(
      "The whole run took {}, of which the fit {} ({} steps, {} parameters); at most {:.2f} GiB of "
      "memory. {}.",
      time_text(verdict.seconds), time_text(metrics.seconds), metrics.steps, metrics.num_parameters,
      verdict.peak_GiB, metrics.threads_why));
  std::vector<std::vector<HtmlCell>> rows{
      {{"stage", ""}, {"epochs", ""}, {"pixels binned by", ""}, {"field", ""}}};
  for (const fit::Stage& stage : metrics.stages)
    rows.push_back({{fmt::format("{}", rows.size()), ""},
                    {fmt::format("{}", stage.epochs), ""},
                    {fmt::format("{}", stage.bin), ""},
                    {stage.field_kind == FieldKind::kGrid ? "plain vertices" : "factors", ""}});
  page.add_table(rows);
}

}  // namespace

std::string run_report(const ReportSource& source) {
  const base::TraceSpan span("report");
  const AllFits fits = fits_of(source.record);
  const record::FitRecord& fit = source.record.fit;
  const std::vector<float> sample = sample_voxels(io::MrcReader(source.volume));
  const EmbeddedVolume volume = embed_volume(source.volume);
  HtmlPage page("Tomogram of " + source.files.stack.filename().string());
  page.add_paragraph(fmt::format("{}, reconstructed with tomofield {} ({})",
                                 source.files.stack.string(), library_version(),
                                 base::source_commit()));
  add_verdict(fit.verdict, page);
  std::vector<HtmlFact> facts = facts_of_size(fit.metrics, volume);
  std::ranges::move(facts_of_fit(fit), std::back_inserter(facts));
  page.add_facts(facts);
  add_volume(source.options.volume.axes, volume, page);
  add_input(source, page);
  add_pictures(source, fits, page);
  add_fit(source, fits, page);
  add_views(fits, page);
  if (source.record.halves) add_halves(*source.record.halves, page);
  add_plot("Histogram",
           "Densities of up to 32 evenly spaced sections of the tomogram. One narrow peak with a "
           "tail on the side of dense matter is usual.",
           histogram_plot(sample), page);
  add_costs(fit, page);
  return page.document();
}

}  // namespace tomofield::report
