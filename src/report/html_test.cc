#include "report/html.h"

#include <gtest/gtest.h>

#include <fstream>

#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::report {
namespace {

TEST(HtmlPage, ShowsTextLiterally) {
  HtmlPage page("<title> & \"more\"");
  page.add_table({{{"a < b", "x"}}, {{"1", "best"}}});
  const std::string document = page.document();
  EXPECT_NE(document.find("<title>&lt;title&gt; &amp; &quot;more&quot;</title>"),
            std::string::npos);
  EXPECT_NE(document.find("<th class=\"x\">a &lt; b</th>"), std::string::npos);
  EXPECT_NE(document.find("<td class=\"best\">1</td>"), std::string::npos);
}

TEST(HtmlPage, RefersToFilesByTheirPaths) {
  HtmlPage page("t");
  HtmlCell cell{.text = "x", .mark = "m"};
  cell.picture = "a b_xy.png";
  cell.links = {{"a \"link\"", "../c:d/50%#?\".mrc"}, {"far", "/data/e.mrc"}};
  page.add_table({{cell}});
  const std::string document = page.document();
  EXPECT_NE(document.find("src=\"./a%20b_xy.png\""), std::string::npos) << document;
  EXPECT_NE(document.find("<a href=\"./../c%3Ad/50%25%23%3F%22.mrc\">a &quot;link&quot;</a>"),
            std::string::npos)
      << document;
  EXPECT_NE(document.find("href=\"file:///data/e.mrc\""), std::string::npos) << document;
}

TEST(HtmlPage, MarksFactsNoticesAndFoldedParts) {
  HtmlPage page("t");
  page.add_facts({{"Residual", "1.02", "a < b"}});
  page.add_notice("Two warnings", {"first", "second & last"}, true);
  page.add_notice("No warning", {}, false);
  page.begin_folded("more");
  page.add_table({{{"option", ""}}, {{"--tlt", ""}}}, TableOf::kWords);
  page.end_folded();
  page.add_svg("<svg></svg>", "what it shows");
  const std::string document = page.document();
  for (const char* part :
       {"<span class=\"name\">Residual</span><b>1.02</b><span class=\"note\">a &lt; b</span>",
        "<div class=\"notice warning\"><strong>Two warnings</strong>\n<p>first</p>",
        "<p>second &amp; last</p>", "<div class=\"notice\"><strong>No warning</strong>",
        "<details><summary>more</summary>\n<table class=\"words\">",
        "<svg></svg><p>what it shows</p>"})
    EXPECT_NE(document.find(part), std::string::npos) << part;
}

TEST(HtmlPage, HasScriptsOnlyForAVolume) {
  HtmlPage page("t");
  EXPECT_EQ(page.document().find("<script"), std::string::npos);
  EmbeddedVolume volume;
  volume.sheets = {"foobar"};
  page.add_volume(volume);
  EXPECT_NE(page.document().find("\"sheets\":[\"Zm9vYmFy\"]"), std::string::npos);
  EXPECT_NE(page.document().find("class Planes"), std::string::npos);
}

TEST(HtmlPage, ContainsItsPictures) {
  const testing::ScratchDirectory directory;
  const auto with_bytes = [&](const char* bytes) {
    std::ofstream(directory.path() / "picture.png") << bytes;
    HtmlPage page("t");
    page.add_figures({{directory.path() / "picture.png", "caption"}});
    return page.document();
  };
  // These are test vectors of RFC 4648, section 10.
  EXPECT_NE(with_bytes("foobar").find("base64,Zm9vYmFy\""), std::string::npos);
  EXPECT_NE(with_bytes("fooba").find("base64,Zm9vYmE=\""), std::string::npos);
  EXPECT_NE(with_bytes("foob").find("base64,Zm9vYg==\""), std::string::npos);
  HtmlPage page("t");
  EXPECT_THROW(page.add_figures({{directory.path() / "none.png", ""}}), Error);
}

}  // namespace
}  // namespace tomofield::report
