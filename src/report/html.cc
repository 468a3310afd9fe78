#include "report/html.h"

#include <fmt/format.h>

#include <string>

#include "report/page_picture.h"
#include "report/page_texts.h"

namespace tomofield::report {
namespace {

// Returns the path of a file as a URL from the page. Bytes that mean something else in a URL are
// written as % and two digits (RFC 3986).
base::Html url_of(const std::filesystem::path& file) {
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
  return base::Html::made(url);
}

base::Html content_of(const HtmlCell& cell) {
  base::Html content = base::Html::of(cell.text);
  if (!cell.picture.empty())
    content +=
        base::Html::format("<img alt=\"\" loading=\"lazy\" src=\"{}\">", url_of(cell.picture));
  for (const HtmlLink& link : cell.links)
    content +=
        base::Html::format("<a href=\"{}\">{}</a>", url_of(link.file), base::Html::of(link.text));
  return content;
}

}  // namespace

HtmlPage::HtmlPage(std::string_view title) : title_(base::Html::of(title)) {
  body_ = base::Html::format("<h1>{}</h1>\n", title_);
}

void HtmlPage::add_heading(std::string_view text) {
  body_ += base::Html::format("<h2>{}</h2>\n", base::Html::of(text));
}

void HtmlPage::add_paragraph(std::string_view text) {
  body_ += base::Html::format("<p>{}</p>\n", base::Html::of(text));
}

void HtmlPage::add_listing(std::string_view text) {
  body_ += base::Html::format("<pre>{}</pre>\n", base::Html::of(text));
}

void HtmlPage::add_table(const std::vector<std::vector<HtmlCell>>& rows, TableOf content) {
  body_ += content == TableOf::kWords ? base::Html("<table class=\"words\">\n") : "<table>\n";
  base::Html element = "th";
  for (const auto& row : rows) {
    body_ += "<tr>";
    for (const HtmlCell& cell : row)
      body_ += base::Html::format("<{0} class=\"{1}\">{2}</{0}>", element,
                                  base::Html::of(cell.mark), content_of(cell));
    body_ += "</tr>\n";
    element = "td";
  }
  body_ += "</table>\n";
}

void HtmlPage::add_figures(const std::vector<HtmlFigure>& figures, FigureSize size) {
  body_ += "<div>\n";
  for (const HtmlFigure& figure : figures) {
    const base::Html caption = base::Html::of(figure.caption);
    body_ += base::Html::format(
        "<figure{2}><img alt=\"{0}\" src=\"{1}\"><figcaption>{0}</figcaption>"
        "</figure>\n",
        caption, base::Html::made(page_picture(figure.picture)),
        size == FigureSize::kLarge ? base::Html(" class=\"large\"") : "");
  }
  body_ += "</div>\n";
}

void HtmlPage::add_svg(const base::Html& svg) {
  body_ += base::Html::format("<div>{}</div>\n", svg);
}

void HtmlPage::add_svg(const base::Html& svg, std::string_view text) {
  body_ +=
      base::Html::format("<div class=\"explained\">{}<p>{}</p></div>\n", svg, base::Html::of(text));
}

void HtmlPage::add_facts(const std::vector<HtmlFact>& facts) {
  body_ += "<div class=\"facts\">\n";
  for (const HtmlFact& fact : facts) {
    body_ += base::Html::format(
        "<div class=\"fact\"><span class=\"name\">{}</span><b>{}</b><span class=\"note\">{}</span>"
        "</div>\n",
        base::Html::of(fact.name), base::Html::of(fact.value), base::Html::of(fact.note));
  }
  body_ += "</div>\n";
}

void HtmlPage::add_notice(std::string_view title, const std::vector<std::string>& paragraphs,
                          bool is_warning) {
  body_ += base::Html::format("<div class=\"notice{}\"><strong>{}</strong>\n",
                              is_warning ? base::Html(" warning") : "", base::Html::of(title));
  for (const std::string& paragraph : paragraphs) add_paragraph(paragraph);
  body_ += "</div>\n";
}

void HtmlPage::add_volume(const EmbeddedVolume& volume) {
  body_ +=
      "<div id=\"volume\" class=\"volume\">The planes are being unpacked …<noscript>The planes "
      "need JavaScript, which is switched "
      "off in this browser.</noscript></div>\n";
  // Base64 and numbers alone: no text that could end the element.
  scripts_ = base::Html::format(
      "<script type=\"application/json\" id=\"volume-data\">{}</script>\n<script>{}</script>\n"
      "<script>{}</script>\n",
      base::Html::made(text_of(volume)), base::Html::made(std::string(planes_script())),
      base::Html::made(std::string(report_script())));
}

void HtmlPage::begin_folded(std::string_view summary) {
  body_ += base::Html::format("<details><summary>{}</summary>\n", base::Html::of(summary));
}

void HtmlPage::end_folded() { body_ += "</details>\n"; }

std::string HtmlPage::document() const {
  const base::Html document = base::Html::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data: "
      "'self' file:; "
      "style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\n"
      "<meta name=\"viewport\" content=\"width=device-width\">\n"
      "<link rel=\"icon\" href=\"data:,\">\n<title>{}</title>\n<style>\n{}</style>\n</head>\n"
      "<body>\n{}{}</body>\n</html>\n",
      title_, base::Html::made(std::string(page_style())), body_, scripts_);
  return document.text();
}

}  // namespace tomofield::report
