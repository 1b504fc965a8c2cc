#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include <boost/beast/http.hpp>

namespace dynamic_slam {

using HttpRequest = boost::beast::http::request<boost::beast::http::string_body>;
using HttpResponse = boost::beast::http::response<boost::beast::http::string_body>;

// Reads one request, of bounded size.
class HttpRequestParser : public boost::beast::http::request_parser<boost::beast::http::string_body> {
 public:
  static constexpr uint32_t kMaxHeaderBytes = 8192;
  static constexpr uint64_t kMaxBodyBytes = 1024;

  HttpRequestParser() {
    header_limit(kMaxHeaderBytes);
    body_limit(kMaxBodyBytes);
  }
};

// The word in the query "...?token=WORD"; "" without one.
std::string_view TokenOf(std::string_view target);

// Why the request is refused, "" when it is not: a page of somewhere else that has our address under a name
// of its own, or that opens a WebSocket to us, would act in the user's name. token: "" when none is needed.
std::string Refusal(const HttpRequest& request, std::string_view address, std::string_view token,
                    bool is_websocket);

// The page and its parts. There is no way from a request to a file.
HttpResponse Answer(const HttpRequest& request);

HttpResponse PlainAnswer(const HttpRequest& request, boost::beast::http::status status,
                         const std::string& text);

}  // namespace dynamic_slam
