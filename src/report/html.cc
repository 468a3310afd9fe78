#include "report/html.h"

#include <fmt/format.h>

#include <cstdint>
#include <fstream>
#include <iterator>

#include "base/utf8.h"
#include "tomofield/error.h"

namespace tomofield::report {
namespace {

constexpr const char* kStyle = R"(
body { font: 15px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 1400px; padding: 0 1em; color: #1a1a1a; }
h1 { font-size: 1.6em; } h2 { font-size: 1.2em; margin-top: 2em; }
table { border-collapse: collapse; } th, td { padding: .25em .8em; text-align: right; border-bottom: 1px solid #ddd; }
th:first-child, td:first-child { text-align: left; min-width: 11em; } th { font-weight: 600; }
td.best { font-weight: 700; } td.better { background: #fde9c8; }
figure { display: inline-block; margin: 0 .6em .6em 0; vertical-align: top; }
figure img { display: block; image-rendering: pixelated; max-width: 100%; width: 320px; }
figcaption { font-size: .9em; } pre { background: #f5f5f5; padding: .8em; overflow-x: auto; }
svg { max-width: 100%; height: auto; }
)";

std::string read_bytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Error(fmt::format("cannot read the picture '{}'", path.string()));
  return {std::istreambuf_iterator<char>(file), {}};
}

// Encodes bytes by RFC 4648, with padding.
std::string base64(std::string_view bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      group <<= 8;
      if (k < count) group |= static_cast<unsigned char>(bytes[i + k]);
    }
    for (std::size_t k = 0; k < 4; ++k)
      text += k <= count ? kDigits[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

}  // namespace

std::string html_text(std::string_view text) {
  std::string escaped;
  for (const char c : base::utf8_text(text)) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

HtmlPage::HtmlPage(std::string_view title) : title_(html_text(title)) {
  body_ = fmt::format("<h1>{}</h1>\n", title_);
}

void HtmlPage::add_heading(std::string_view text) {
  body_ += fmt::format("<h2>{}</h2>\n", html_text(text));
}

void HtmlPage::add_paragraph(std::string_view text) {
  body_ += fmt::format("<p>{}</p>\n", html_text(text));
}

void HtmlPage::add_listing(std::string_view text) {
  body_ += fmt::format("<pre>{}</pre>\n", html_text(text));
}

void HtmlPage::add_table(const std::vector<std::vector<HtmlCell>>& rows) {
  body_ += "<table>\n";
  const char* element = "th";
  for (const auto& row : rows) {
    body_ += "<tr>";
    for (const HtmlCell& cell : row)
      body_ +=
          fmt::format("<{0} class=\"{1}\">{2}</{0}>", element, cell.mark, html_text(cell.text));
    body_ += "</tr>\n";
    element = "td";
  }
  body_ += "</table>\n";
}

void HtmlPage::add_figures(const std::vector<HtmlFigure>& figures) {
  body_ += "<div>\n";
  for (const HtmlFigure& figure : figures) {
    const std::string caption = html_text(figure.caption);
    body_ += fmt::format(
        "<figure><img alt=\"{0}\" src=\"data:image/png;base64,{1}\"><figcaption>{0}</figcaption>"
        "</figure>\n",
        caption, base64(read_bytes(figure.picture)));
  }
  body_ += "</div>\n";
}

void HtmlPage::add_svg(std::string_view svg) { body_ += fmt::format("<div>{}</div>\n", svg); }

std::string HtmlPage::document() const {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<link rel=\"icon\" href=\"data:,\">\n<title>{}</title>\n<style>{}</style>\n</head>\n"
      "<body>\n{}</body>\n</html>\n",
      title_, kStyle, body_);
}

}  // namespace tomofield::report
