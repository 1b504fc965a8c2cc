#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "dynamic_slam/viewer/message.h"

namespace dynamic_slam {

// What browsers watch. Everything is called in the server's thread.
class Show {
 public:
  virtual ~Show() = default;

  // What brings a browser that comes now, or that could not follow, up to date.
  virtual std::vector<Message> Backlog() = 0;

  // What a browser wishes, such as "pause". Anybody may have sent it.
  virtual void OnCommand(std::string_view command) = 0;

  // The last browser has been gone for a while.
  virtual void OnNobodyWatches() {}
};

struct ServerOptions {
  std::string address = "127.0.0.1";  // IP address to listen at
  uint16_t port = 0;                  // 0: any that is free
  bool with_token = false;            // browsers must know a random word, which is in url()
};

// Whether only this machine can reach the address.
bool IsLoopback(const std::string& address);

// Serves the page of the viewer over HTTP and tells the browsers that show it, over WebSocket, what there is
// to be seen, in a thread of its own. What is read is bounded in size, number and time; for a browser that
// does not keep up, what waits is thrown away, and when it is back it gets the backlog.
class ViewerServer {
 public:
  // The show must outlive the server. Throws InputError when it cannot listen there.
  ViewerServer(const ServerOptions& options, Show* show);
  ~ViewerServer();
  ViewerServer(const ViewerServer&) = delete;
  ViewerServer& operator=(const ViewerServer&) = delete;

  // Takes browsers from now on.
  void Start();

  // For a browser's address line.
  std::string url() const;

  // Runs a task in the server's thread, now or after a while.
  void Post(std::function<void()> task);
  void PostAfter(std::chrono::milliseconds delay, std::function<void()> task);

  // In the server's thread: a message to all browsers, or to each of them the backlog instead of all that
  // waits.
  void Broadcast(const Message& message);
  void Refresh();
  bool HasBrowsers() const;

  // Waits until every browser has been told everything, at most so long.
  void Flush(std::chrono::milliseconds patience);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dynamic_slam
