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
