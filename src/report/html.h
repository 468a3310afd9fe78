#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace tomofield::report {

/// Text as HTML shows it literally.
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

/// A page that is one file: pictures, plots and style are in it, and it asks no network for
/// anything. All texts are plain and become HTML here.
class HtmlPage {
 public:
  explicit HtmlPage(std::string_view title);
  void add_heading(std::string_view text);
  void add_paragraph(std::string_view text);
  /// Lines in a fixed-width font.
  void add_listing(std::string_view text);
  /// The first row is the head; numbers are set to the right, the first column to the left.
  void add_table(const std::vector<std::vector<HtmlCell>>& rows);
  /// Side by side, as many as fit. Throws Error if a picture cannot be read.
  void add_figures(const std::vector<HtmlFigure>& figures);
  /// An SVG element as it is (report/curve_plot.h).
  void add_svg(std::string_view svg);
  /// The whole document.
  std::string document() const;

 private:
  std::string title_, body_;
};

}  // namespace tomofield::report
