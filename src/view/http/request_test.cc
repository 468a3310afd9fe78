#include "view/http/request.h"

#include <gtest/gtest.h>

#include "tomofield/error.h"

namespace tomofield::view {
namespace {

using Parameters = std::map<std::string, std::string>;

TEST(ParseQuery, DecodesNamesAndValues) {
  EXPECT_EQ(parse_query(""), Parameters());
  EXPECT_EQ(parse_query("a=1&b=1%2C2%2c3&c=x+y&%64=&e"),
            (Parameters{{"a", "1"}, {"b", "1,2,3"}, {"c", "x y"}, {"d", ""}, {"e", ""}}));
  for (const char* text : {"a=%", "a=%4", "a=%4g", "a=%-1", "%=1", "a=1&a=2", "a=1&%61=2"})
    EXPECT_THROW(parse_query(text), Error) << text;
}

TEST(ParseRequest, ReadsWhatTheServerLooksAt) {
  const Request request = parse_request(
      "GET /key/plane?step=2 HTTP/1.1\r\nhOST: \t127.0.0.1:80 \r\nCookie: a=b\r\n"
      "Content-Length: 0");
  EXPECT_EQ(request.method, "GET");
  EXPECT_EQ(request.path, "/key/plane");
  EXPECT_EQ(request.parameters, (Parameters{{"step", "2"}}));
  EXPECT_EQ(request.host, "127.0.0.1:80");
  EXPECT_TRUE(request.keeps_open);
  EXPECT_FALSE(request.has_body);
  EXPECT_FALSE(parse_request("GET / HTTP/1.0").keeps_open);
  EXPECT_FALSE(parse_request("GET / HTTP/1.1\r\nConnection: Close").keeps_open);
  EXPECT_TRUE(parse_request("POST / HTTP/1.1\r\nContent-Length: 5").has_body);
  EXPECT_TRUE(parse_request("POST / HTTP/1.1\r\nTransfer-Encoding: chunked").has_body);
}

TEST(ParseRequest, RefusesWhatIsNone) {
  for (const char* head :
       {"", "GET", "GET /", "GET / HTTP/9.9", "GET / HTTP/1.1 ", "GET  / HTTP/1.1",
        "GET http://a/ HTTP/1.1", "GET /\x01 HTTP/1.1", " / HTTP/1.1", "GET / HTTP/1.1\r\nHost",
        "GET / HTTP/1.1\r\n: a", "GET / HTTP/1.1\r\nA: b\r\n folded: c",
        "GET / HTTP/1.1\r\nHost: a\r\nHost: b", "GET /?a=1&a=2 HTTP/1.1"})
    EXPECT_THROW(parse_request(head), Error) << head;
}

}  // namespace
}  // namespace tomofield::view
