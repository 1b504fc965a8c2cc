#include "dynamic_slam/viewer/http_answer.h"

#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

namespace http = boost::beast::http;

HttpRequest Request(const std::string& target, const std::string& host, const std::string& origin = "") {
  HttpRequest request(http::verb::get, target, 11);
  request.set(http::field::host, host);
  if (!origin.empty()) request.set(http::field::origin, origin);
  return request;
}

TEST(HttpAnswerTest, TokenIsFoundInTheQuery) {
  EXPECT_EQ(TokenOf("/live?token=abc"), "abc");
  EXPECT_EQ(TokenOf("/live?x=1&token=abc&y=2"), "abc");
  EXPECT_EQ(TokenOf("/live?x=token=abc"), "");
  EXPECT_EQ(TokenOf("/token=abc"), "");
  EXPECT_EQ(TokenOf("/?&&"), "");
}

TEST(HttpAnswerTest, OnlyOurOwnPageMayConnect) {
  const auto refusal = [](const HttpRequest& request, const std::string& token) {
    return Refusal(request, "127.0.0.1", token, true);
  };
  EXPECT_EQ(refusal(Request("/live", "localhost:80", "http://localhost:80"), ""), "");
  EXPECT_EQ(refusal(Request("/live", "[::1]:80"), ""), "");
  EXPECT_NE(refusal(Request("/live", "localhost:80", "http://other.example"), ""), "");
  EXPECT_NE(refusal(Request("/live", "other.example:80", "http://other.example:80"), ""), "");
  EXPECT_EQ(refusal(Request("/live?token=abc", "robot:80", "http://robot:80"), "abc"), "");
  EXPECT_NE(refusal(Request("/live?token=abd", "robot:80", "http://robot:80"), "abc"), "");
  EXPECT_NE(refusal(Request("/live", "robot:80"), "abc"), "");
}

TEST(HttpAnswerTest, ThePageNamesOnlyPartsThatThereAre) {
  const std::string page = Answer(Request("/", "localhost")).body();
  size_t parts = 0;
  for (const std::string key : {"src=\"", "href=\""}) {
    for (size_t at = page.find(key); at != std::string::npos; at = page.find(key, at + 1)) {
      const size_t start = at + key.size();
      const std::string name = page.substr(start, page.find('"', start) - start);
      if (name.starts_with("data:")) continue;
      EXPECT_EQ(Answer(Request("/" + name, "localhost")).result(), http::status::ok) << name;
      ++parts;
    }
  }
  EXPECT_GE(parts, 6u);
}

}  // namespace
}  // namespace dynamic_slam
