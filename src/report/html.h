#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/code_text.h"
#include "report/embedded_volume.h"

namespace tomofield::report {

/// A link to a file, by its path from the page.
struct HtmlLink {
  std::string text;
  std::filesystem::path file;
};

/// A cell of a table; `mark` is a class of the page's style sheet, or empty. Pages of many pictures
/// leave these in files of their own: `picture` is the path of one from the page.
struct HtmlCell {
  std::string text;
  std::string mark;
  std::filesystem::path picture = {};
  std::vector<HtmlLink> links = {};
};

/// The content of the cells beside the first column of a table: numbers, which are aligned to the
/// right, or words.
enum class TableOf { kNumbers, kWords };

/// A picture with a line below it.
struct HtmlFigure {
  std::filesystem::path picture;  ///< PNG, which the page contains
  std::string caption;
};

/// The size at which figures are shown: several side by side, or as they are.
enum class FigureSize { kSmall, kLarge };

/// A number that a page states: its name, its value, and a sentence that says how to read it.
struct HtmlFact {
  std::string name, value, note;
};

/// A page in one file, which contains its pictures, plots, style and scripts. It forbids the
/// browser to ask the network for anything; pictures may be files beside it. All texts are plain;
/// the page turns them into HTML.
class HtmlPage {
 public:
  explicit HtmlPage(std::string_view title);
  void add_heading(std::string_view text);
  void add_paragraph(std::string_view text);
  /// Adds lines in a fixed-width font.
  void add_listing(std::string_view text);
  /// Adds a table. The first row is the head. The first column is aligned to the left.
  void add_table(const std::vector<std::vector<HtmlCell>>& rows,
                 TableOf content = TableOf::kNumbers);
  /// Adds figures side by side, as many as fit. Throws Error if a picture cannot be read.
  void add_figures(const std::vector<HtmlFigure>& figures, FigureSize size = FigureSize::kSmall);
  /// Adds an SVG element without a change (report/curve_plot.h).
  void add_svg(const base::Html& svg);
  /// Adds an SVG element with a text beside it.
  void add_svg(const base::Html& svg, std::string_view text);
  /// Adds numbers side by side.
  void add_facts(const std::vector<HtmlFact>& facts);
  /// Adds a framed text: a title and paragraphs. A warning has another colour.
  void add_notice(std::string_view title, const std::vector<std::string>& paragraphs,
                  bool is_warning);
  /// Adds three linked planes of a volume to scroll through. A page has at most one volume.
  void add_volume(const EmbeddedVolume& volume);
  /// Fold what is added between these two calls under a line that the reader opens.
  void begin_folded(std::string_view summary);
  void end_folded();
  /// Returns the whole document.
  std::string document() const;

 private:
  base::Html title_, body_, scripts_;
};

}  // namespace tomofield::report
