#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace tomofield::report {

/// Returns a text with the special characters of HTML replaced.
std::string html_text(std::string_view text);

/// A cell of a table; `mark` is a class of the page's style sheet, or empty.
struct HtmlCell {
  std::string text;
  std::string mark;
};

/// A picture with a line below it.
struct HtmlFigure {
  std::filesystem::path picture;  ///< PNG, which the page contains
  std::string caption;
};

/// A page in one file, which contains its pictures, plots and style and asks no network for
/// anything. All texts are plain; the page turns them into HTML.
class HtmlPage {
 public:
  explicit HtmlPage(std::string_view title);
  void add_heading(std::string_view text);
  void add_paragraph(std::string_view text);
  /// Adds lines in a fixed-width font.
  void add_listing(std::string_view text);
  /// Adds a table. The first row is the head. The first column is aligned to the left, numbers to
  /// the right.
  void add_table(const std::vector<std::vector<HtmlCell>>& rows);
  /// Adds figures side by side, as many as fit. Throws Error if a picture cannot be read.
  void add_figures(const std::vector<HtmlFigure>& figures);
  /// Adds an SVG element without a change (report/curve_plot.h).
  void add_svg(std::string_view svg);
  /// Returns the whole document.
  std::string document() const;

 private:
  std::string title_, body_;
};

}  // namespace tomofield::report
