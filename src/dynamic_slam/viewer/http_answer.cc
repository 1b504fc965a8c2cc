#include "dynamic_slam/viewer/http_answer.h"

#include <algorithm>

#include "dynamic_slam/viewer/page_parts.h"

namespace dynamic_slam {
namespace {

namespace http = boost::beast::http;

struct Part {
  std::string_view path, type, text;
};

std::string_view View(boost::beast::string_view text) { return {text.data(), text.size()}; }

// The host of "host:port" or "[v6]:port".
std::string_view HostName(std::string_view host) {
  const size_t colon = host.rfind(':');
  const size_t bracket = host.rfind(']');
  const bool has_port =
      colon != std::string_view::npos && (bracket == std::string_view::npos || colon > bracket);
  if (has_port) host = host.substr(0, colon);
  if (host.size() >= 2 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  return host;
}

// In a time that does not tell how much of it is right.
bool IsSame(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  unsigned difference = 0;
  for (size_t i = 0; i < a.size(); ++i) difference |= static_cast<unsigned>(a[i] ^ b[i]);
  return difference == 0;
}

HttpResponse Basic(const HttpRequest& request, http::status status, std::string_view type,
                   std::string_view text) {
  HttpResponse response(status, request.version());
  response.set(http::field::content_type, boost::beast::string_view(type.data(), type.size()));
  response.set(http::field::cache_control, "no-cache");
  response.set("X-Content-Type-Options", "nosniff");
  response.set("Referrer-Policy", "no-referrer");
  response.set("Content-Security-Policy",
               "default-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'; base-uri 'none'");
  response.keep_alive(request.keep_alive());
  if (request.method() != http::verb::head) response.body() = text;
  response.content_length(text.size());
  return response;
}

}  // namespace

std::string_view TokenOf(std::string_view target) {
  constexpr std::string_view kKey = "token=";
  const size_t query = target.find('?');
  if (query == std::string_view::npos) return "";
  std::string_view rest = target.substr(query + 1);
  while (!rest.empty()) {
    const std::string_view field = rest.substr(0, rest.find('&'));
    if (field.starts_with(kKey)) return field.substr(kKey.size());
    rest.remove_prefix(std::min(rest.size(), field.size() + 1));
  }
  return "";
}

std::string Refusal(const HttpRequest& request, std::string_view address, std::string_view token,
                    bool is_websocket) {
  const std::string_view host = View(request[http::field::host]);
  if (token.empty()) {
    const std::string_view name = HostName(host);
    const bool is_ours = name == "localhost" || name == "127.0.0.1" || name == "::1" || name == address;
    if (!is_ours) return "this server has another name";
  }
  if (!is_websocket) return "";
  const auto origin = request.find(http::field::origin);
  if (origin != request.end() && View(origin->value()) != "http://" + std::string(host)) {
    return "only the viewer's own page may connect";
  }
  if (!token.empty() && !IsSame(TokenOf(View(request.target())), token)) {
    return "the token is missing or wrong: open the address that the program printed";
  }
  return "";
}

HttpResponse PlainAnswer(const HttpRequest& request, http::status status, const std::string& text) {
  return Basic(request, status, "text/plain; charset=utf-8", text + "\n");
}

HttpResponse Answer(const HttpRequest& request) {
  if (request.method() != http::verb::get && request.method() != http::verb::head) {
    return PlainAnswer(request, http::status::method_not_allowed, "only GET");
  }
  const Part parts[] = {
      {"/", "text/html; charset=utf-8", kViewerHtml},
      {"/viewer.css", "text/css; charset=utf-8", kViewerStyle},
      {"/map.js", "text/javascript; charset=utf-8", kViewerMap},
      {"/video.js", "text/javascript; charset=utf-8", kViewerVideo},
      {"/viewer.js", "text/javascript; charset=utf-8", kViewerScript},
      {"/three.js", "text/javascript; charset=utf-8", kThree},
      {"/orbit.js", "text/javascript; charset=utf-8", kThreeOrbit},
  };
  const std::string_view target = View(request.target());
  const std::string_view path = target.substr(0, target.find('?'));
  for (const Part& part : parts) {
    if (part.path == path) return Basic(request, http::status::ok, part.type, part.text);
  }
  return PlainAnswer(request, http::status::not_found, "there is no such page");
}

}  // namespace dynamic_slam
