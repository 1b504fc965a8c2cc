// What browsers send, and recordings.

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/viewer/http_answer.h"
#include "dynamic_slam/viewer/player_command.h"
#include "dynamic_slam/viewer/recording.h"
#include "readers.h"

namespace dynamic_slam {

void ReadViewerRecording(std::string_view bytes, const std::filesystem::path& folder) {
  const std::filesystem::path file = Put(folder / kRecordingName, bytes);
  IsTaken(file.string(), [&] {
    RecordingReader recording(file);
    for (size_t i = 0; i < recording.entries().size(); ++i) {
      DS_CHECK(recording.Read(i)->size() == recording.entries()[i].bytes, "entry {}", i);
    }
    JsonMessage(MessageType::kHello, 0, recording.Hello());
  });
}

void ReadViewerRequest(std::string_view bytes, const std::filesystem::path&) {
  namespace http = boost::beast::http;
  HttpRequestParser parser;
  boost::system::error_code error;
  parser.eager(true);
  parser.put(boost::asio::buffer(bytes.data(), bytes.size()), error);
  if (error || !parser.is_done()) return;
  const HttpRequest& request = parser.get();
  Refusal(request, "192.0.2.1", "0123456789abcdef", true);
  if (Refusal(request, "127.0.0.1", "", true).empty()) {
    const boost::beast::string_view host = request[http::field::host];
    DS_CHECK(host.starts_with("localhost") || host.starts_with("127.0.0.1") || host.starts_with("[") ||
                 host.starts_with("::1"),
             "{}", std::string(host));
  }
  const HttpResponse answer = Answer(request);
  const unsigned status = answer.result_int();
  DS_CHECK(status == 200 || status == 404 || status == 405, "{}", status);
}

void ReadViewerCommand(std::string_view bytes, const std::filesystem::path&) {
  const auto command = ParsePlayerCommand(bytes);
  if (!command.has_value()) return;
  using Kind = PlayerCommand::Kind;
  DS_CHECK(command->kind != Kind::kSeek || (command->number >= 0 && command->number < 1e9), "{}",
           command->number);
  DS_CHECK(command->kind != Kind::kSpeed || (command->number >= 0.1 && command->number <= 20), "{}",
           command->number);
}

}  // namespace dynamic_slam
