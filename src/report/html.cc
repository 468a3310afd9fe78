#include "report/html.h"

#include <fmt/format.h>

#include "base/utf8.h"
#include "report/page_picture.h"
#include "report/page_texts.h"

namespace tomofield::report {
namespace {

// Returns the path of a file as a URL from the page. Bytes that mean something else in a URL are
// written as % and two digits (RFC 3986).
std::string url_of(const std::filesystem::path& file) {
  constexpr std::string_view kPlain =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-._~/";
  std::string url = "./";  // no name can be taken for a scheme, as in "a:b"
  if (file.is_absolute()) url = "file://";
  for (const char c : file.string()) {
    if (kPlain.find(c) != std::string_view::npos)
      url += c;
    else
      url += fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return url;
}

std::string content_of(const HtmlCell& cell) {
  std::string content = html_text(cell.text);
  if (!cell.picture.empty())
    content += fmt::format("<img alt=\"\" loading=\"lazy\" src=\"{}\">", url_of(cell.picture));
  for (const HtmlLink& link : cell.links)
    content += fmt::format("<a href=\"{}\">{}</a>", url_of(link.file), html_text(link.text));
  return content;
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

void HtmlPage::add_table(const std::vector<std::vector<HtmlCell>>& rows, TableOf content) {
  body_ += content == TableOf::kWords ? "<table class=\"words\">\n" : "<table>\n";
  const char* element = "th";
  for (const auto& row : rows) {
    body_ += "<tr>";
    for (const HtmlCell& cell : row)
      body_ += fmt::format("<{0} class=\"{1}\">{2}</{0}>", element, cell.mark, content_of(cell));
    body_ += "</tr>\n";
    element = "td";
  }
  body_ += "</table>\n";
}

void HtmlPage::add_figures(const std::vector<HtmlFigure>& figures, FigureSize size) {
  body_ += "<div>\n";
  for (const HtmlFigure& figure : figures) {
    const std::string caption = html_text(figure.caption);
    body_ += fmt::format(
        "<figure{2}><img alt=\"{0}\" src=\"{1}\"><figcaption>{0}</figcaption>"
        "</figure>\n",
        caption, page_picture(figure.picture),
        size == FigureSize::kLarge ? " class=\"large\"" : "");
  }
  body_ += "</div>\n";
}

void HtmlPage::add_svg(std::string_view svg) { body_ += fmt::format("<div>{}</div>\n", svg); }

void HtmlPage::add_svg(std::string_view svg, std::string_view text) {
  body_ += fmt::format("<div class=\"explained\">{}<p>{}</p></div>\n", svg, html_text(text));
}

void HtmlPage::add_facts(const std::vector<HtmlFact>& facts) {
  body_ += "<div class=\"facts\">\n";
  for (const HtmlFact& fact : facts) {
    body_ += fmt::format(
        "<div class=\"fact\"><span class=\"name\">{}</span><b>{}</b><span class=\"note\">{}</span>"
        "</div>\n",
        html_text(fact.name), html_text(fact.value), html_text(fact.note));
  }
  body_ += "</div>\n";
}

void HtmlPage::add_notice(std::string_view title, const std::vector<std::string>& paragraphs,
                          bool is_warning) {
  body_ += fmt::format("<div class=\"notice{}\"><strong>{}</strong>\n",
                       is_warning ? " warning" : "", html_text(title));
  for (const std::string& paragraph : paragraphs) add_paragraph(paragraph);
  body_ += "</div>\n";
}

void HtmlPage::add_volume(const EmbeddedVolume& volume) {
  body_ +=
      "<div id=\"volume\" class=\"volume\">The planes are being unpacked …<noscript>The planes "
      "need JavaScript, which is switched "
      "off in this browser.</noscript></div>\n";
  // Base64 and numbers alone: no text that could end the element.
  scripts_ = fmt::format(
      "<script type=\"application/json\" id=\"volume-data\">{}</script>\n<script>{}</script>\n"
      "<script>{}</script>\n",
      volume_json(volume).dump(), planes_script(), report_script());
}

void HtmlPage::begin_folded(std::string_view summary) {
  body_ += fmt::format("<details><summary>{}</summary>\n", html_text(summary));
}

void HtmlPage::end_folded() { body_ += "</details>\n"; }

std::string HtmlPage::document() const {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data: "
      "'self' file:; "
      "style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\n"
      "<meta name=\"viewport\" content=\"width=device-width\">\n"
      "<link rel=\"icon\" href=\"data:,\">\n<title>{}</title>\n<style>\n{}</style>\n</head>\n"
      "<body>\n{}{}</body>\n</html>\n",
      title_, page_style(), body_, scripts_);
}

}  // namespace tomofield::report
