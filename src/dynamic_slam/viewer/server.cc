#include "dynamic_slam/viewer/server.h"

#include <algorithm>
#include <atomic>
#include <deque>
#include <future>
#include <optional>
#include <random>
#include <utility>

#include <boost/asio.hpp>
#include <boost/beast.hpp>
#include <fmt/format.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/worker.h"
#include "dynamic_slam/viewer/http_answer.h"

namespace dynamic_slam {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using boost::system::error_code;
using tcp = asio::ip::tcp;

// Bounds on what anybody can make us do.
constexpr int kMaxConnections = 64;           // of all kinds, at a time
constexpr size_t kMaxBrowsers = 16;           // of these, with a WebSocket
constexpr size_t kMaxCommandBytes = 256;      // of a message over the WebSocket
constexpr std::chrono::seconds kPatience(5);  // for a request or an answer
constexpr std::chrono::seconds kSilence(30);  // of a browser, which answers pings
constexpr std::chrono::seconds kAbsence(5);   // after which nobody is said to watch
constexpr size_t kMaxWaitingBytes = 4 << 20;  // to one browser, beside what is being written

std::string RandomToken() {
  // random_device is the kernel's generator with this library.
  std::random_device device;
  return fmt::format("{:08x}{:08x}{:08x}{:08x}", device(), device(), device(), device());
}

}  // namespace

bool IsLoopback(const std::string& address) {
  error_code error;
  const asio::ip::address parsed = asio::ip::make_address(address, error);
  return !error && parsed.is_loopback();
}

class ViewerServer::Impl {
 public:
  Impl(const ServerOptions& options, Show* show)
      : options_(options),
        show_(show),
        acceptor_(io_),
        worker_("viewer", Worker::kForever, Worker::Priority::kBackground) {
    if (options.with_token) token_ = RandomToken();
    Listen();
  }

  void Start() {
    Accept();
    worker_.Post([this](const std::stop_token& token) {
      const std::stop_callback stop(token, [this] { io_.stop(); });
      const auto guard = asio::make_work_guard(io_);
      io_.run();
    });
  }

  std::string url() const {
    const asio::ip::address address = endpoint_.address();
    const std::string host = address.is_v6() ? "[" + address.to_string() + "]" : address.to_string();
    return fmt::format("http://{}:{}/{}", host, endpoint_.port(), token_.empty() ? "" : "?token=" + token_);
  }

  void Post(std::function<void()> task) { asio::post(io_, std::move(task)); }

  void PostAfter(std::chrono::milliseconds delay, std::function<void()> task) {
    asio::post(io_, [this, delay, task = std::move(task)]() mutable {
      const auto timer = std::make_shared<asio::steady_timer>(io_, delay);
      timer->async_wait([timer, task = std::move(task)](const error_code& error) {
        if (!error) task();
      });
    });
  }

  void Broadcast(const Message& message) {
    for (const auto& browser : browsers_) browser->Send(message);
  }

  void Refresh() {
    if (browsers_.empty()) return;
    const std::vector<Message> backlog = show_->Backlog();
    for (const auto& browser : browsers_) browser->SendBacklog(backlog);
  }

  bool HasBrowsers() const { return !browsers_.empty(); }

  void Flush(std::chrono::milliseconds patience) {
    const auto deadline = std::chrono::steady_clock::now() + patience;
    bool is_done = false;
    while (!is_done && std::chrono::steady_clock::now() < deadline) {
      const auto answer = std::make_shared<std::promise<bool>>();
      std::future<bool> all_told = answer->get_future();
      PostAfter(std::chrono::milliseconds(5), [this, answer] {
        answer->set_value(
            std::all_of(browsers_.begin(), browsers_.end(), [](const auto& b) { return b->IsIdle(); }));
      });
      if (all_told.wait_until(deadline) != std::future_status::ready) return;
      is_done = all_told.get();
    }
  }

 private:
  // Counts while it lives.
  class Place {
   public:
    explicit Place(int* count) : count_(count) { ++*count_; }
    ~Place() { --*count_; }
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;

   private:
    int* count_;
  };

  // A page that watches.
  class Browser : public std::enable_shared_from_this<Browser> {
   public:
    Browser(Impl* server, tcp::socket socket, std::unique_ptr<Place> place)
        : server_(server), stream_(std::move(socket)), place_(std::move(place)) {
      websocket::stream_base::timeout timeout{};
      timeout.handshake_timeout = kPatience;
      timeout.idle_timeout = kSilence;
      timeout.keep_alive_pings = true;
      stream_.set_option(timeout);
      stream_.read_message_max(kMaxCommandBytes);
      stream_.binary(true);
    }

    void Start(const HttpRequest& request) {
      stream_.async_accept(request, [self = shared_from_this()](const error_code& error) {
        if (error) return;
        self->server_->browsers_.push_back(self);
        self->SendBacklog(self->server_->show_->Backlog());
        self->Read();
      });
    }

    void Send(const Message& message) {
      if (is_behind_) return;
      if (HeaderOf(*message).type == MessageType::kFrame) DropFrame();
      if (waiting_bytes_ + message->size() > kMaxWaitingBytes) {
        waiting_.clear();
        waiting_bytes_ = 0;
        is_behind_ = true;
      } else {
        waiting_.push_back(message);
        waiting_bytes_ += message->size();
      }
      Write();
    }

    // Instead of all that waits. It is as large as the map, so the bound on what waits is not for it.
    void SendBacklog(const std::vector<Message>& backlog) {
      waiting_.clear();
      waiting_bytes_ = 0;
      is_behind_ = false;
      backlog_.assign(backlog.begin(), backlog.end());
      Write();
    }

    bool IsIdle() const { return in_work_ == nullptr; }

   private:
    // Only the newest frame is worth showing.
    void DropFrame() {
      std::erase_if(waiting_, [this](const Message& waiting) {
        const bool is_frame = HeaderOf(*waiting).type == MessageType::kFrame;
        if (is_frame) waiting_bytes_ -= waiting->size();
        return is_frame;
      });
    }

    // The next message, if none is on its way.
    void Write() {
      if (in_work_ != nullptr) return;
      if (!backlog_.empty()) {
        in_work_ = std::move(backlog_.front());
        backlog_.pop_front();
      } else if (!waiting_.empty()) {
        in_work_ = std::move(waiting_.front());
        waiting_.pop_front();
        waiting_bytes_ -= in_work_->size();
      } else if (is_behind_) {
        return SendBacklog(server_->show_->Backlog());
      } else {
        return;
      }
      stream_.async_write(asio::buffer(*in_work_),
                          [self = shared_from_this()](const error_code& error, size_t) {
                            if (error) return self->End();
                            self->in_work_ = nullptr;
                            self->Write();
                          });
    }

    void Read() {
      stream_.async_read(buffer_, [self = shared_from_this()](const error_code& error, size_t) {
        if (error) return self->End();
        const std::string command = beast::buffers_to_string(self->buffer_.data());
        self->buffer_.consume(self->buffer_.size());
        self->server_->show_->OnCommand(command);
        self->Read();
      });
    }

    void End() {
      if (std::erase(server_->browsers_, shared_from_this()) > 0) server_->NoteLeaving();
      beast::close_socket(beast::get_lowest_layer(stream_));
    }

    Impl* server_;
    websocket::stream<beast::tcp_stream> stream_;
    std::unique_ptr<Place> place_;
    beast::flat_buffer buffer_{kMaxCommandBytes + 16};
    std::deque<Message> backlog_, waiting_;
    size_t waiting_bytes_ = 0;
    Message in_work_;
    bool is_behind_ = false;
  };

  // Somebody who asks for pages, and maybe becomes a browser.
  class Visitor : public std::enable_shared_from_this<Visitor> {
   public:
    Visitor(Impl* server, tcp::socket socket)
        : server_(server),
          stream_(std::move(socket)),
          place_(std::make_unique<Place>(&server->connections_)) {}

    void Read() {
      parser_.emplace();
      stream_.expires_after(kPatience);  // for the whole request, however slowly it drips
      http::async_read(stream_, buffer_, *parser_,
                       [self = shared_from_this()](const error_code& error, size_t) {
                         if (!error) self->Reply(self->parser_->get());
                       });
    }

   private:
    void Reply(const HttpRequest& request) {
      const bool is_websocket = websocket::is_upgrade(request);
      const std::string refusal = Refusal(request, server_->options_.address, server_->token_, is_websocket);
      if (!refusal.empty()) return Write(PlainAnswer(request, http::status::forbidden, refusal));
      if (!is_websocket) return Write(Answer(request));
      const std::string_view target(request.target().data(), request.target().size());
      if (target.substr(0, target.find('?')) != "/live") {
        return Write(PlainAnswer(request, http::status::not_found, "the view is at /live"));
      }
      if (server_->browsers_.size() >= kMaxBrowsers) {
        return Write(PlainAnswer(request, http::status::service_unavailable, "too many browsers watch"));
      }
      stream_.expires_never();  // a WebSocket has its own timeouts
      std::make_shared<Browser>(server_, stream_.release_socket(), std::move(place_))->Start(request);
    }

    void Write(HttpResponse response) {
      response_ = std::move(response);
      stream_.expires_after(kPatience);
      http::async_write(stream_, response_, [self = shared_from_this()](const error_code& error, size_t) {
        if (error) return;
        if (self->response_.need_eof()) {
          error_code ignored;
          self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
        } else {
          self->Read();
        }
      });
    }

    Impl* server_;
    beast::tcp_stream stream_;
    std::unique_ptr<Place> place_;
    beast::flat_buffer buffer_{HttpRequestParser::kMaxHeaderBytes + HttpRequestParser::kMaxBodyBytes};
    std::optional<HttpRequestParser> parser_;
    HttpResponse response_;
  };

  // A page that is loaded again is away for a moment.
  void NoteLeaving() {
    PostAfter(kAbsence, [this] {
      if (browsers_.empty()) show_->OnNobodyWatches();
    });
  }

  void Listen() {
    error_code error;
    const asio::ip::address address = asio::ip::make_address(options_.address, error);
    if (error) {
      throw InputError("--viewer-address", fmt::format("'{}' is no IP address", options_.address),
                       "Give one of this machine, or 0.0.0.0 for all of them.");
    }
    const tcp::endpoint wanted(address, options_.port);
    const auto then = [&error](auto&& step) {
      if (!error) step();
    };
    acceptor_.open(wanted.protocol(), error);
    then([&] { acceptor_.set_option(asio::socket_base::reuse_address(true), error); });
    then([&] { acceptor_.bind(wanted, error); });
    then([&] { acceptor_.listen(kMaxConnections, error); });
    if (error) {
      throw InputError(
          "--viewer",
          fmt::format("cannot listen at {} port {}: {}", options_.address, options_.port, error.message()),
          "Give another port, or 0 for any that is free.");
    }
    endpoint_ = acceptor_.local_endpoint();
  }

  void Accept() {
    acceptor_.async_accept([this](const error_code& error, tcp::socket socket) {
      if (error == asio::error::operation_aborted) return;
      if (error) {  // out of descriptors, say: not again at once
        return PostAfter(std::chrono::milliseconds(100), [this] { Accept(); });
      }
      // Who is one too many is hung up on, which costs less than an answer.
      if (connections_ < kMaxConnections) std::make_shared<Visitor>(this, std::move(socket))->Read();
      Accept();
    });
  }

  const ServerOptions options_;
  Show* const show_;
  std::string token_;
  int connections_ = 0;
  asio::io_context io_{1};
  std::vector<std::shared_ptr<Browser>> browsers_;  // go before what their sockets belong to
  tcp::acceptor acceptor_;
  tcp::endpoint endpoint_;
  Worker worker_;  // last: its thread uses all the others
};

ViewerServer::ViewerServer(const ServerOptions& options, Show* show)
    : impl_(std::make_unique<Impl>(options, show)) {}
ViewerServer::~ViewerServer() = default;
void ViewerServer::Start() { impl_->Start(); }
std::string ViewerServer::url() const { return impl_->url(); }
void ViewerServer::Post(std::function<void()> task) { impl_->Post(std::move(task)); }
void ViewerServer::PostAfter(std::chrono::milliseconds delay, std::function<void()> task) {
  impl_->PostAfter(delay, std::move(task));
}
void ViewerServer::Broadcast(const Message& message) { impl_->Broadcast(message); }
void ViewerServer::Refresh() { impl_->Refresh(); }
bool ViewerServer::HasBrowsers() const { return impl_->HasBrowsers(); }
void ViewerServer::Flush(std::chrono::milliseconds patience) { impl_->Flush(patience); }

}  // namespace dynamic_slam
