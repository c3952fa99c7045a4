/// @file
/// A server that says what a test wants, on a port of this machine.
#pragma once

#include <google/rpc/status.pb.h>

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <sketchmatch/raw.hpp>
#include <string>
#include <vector>

namespace sketchmatch::test {

class FakeServer {
 public:
  /// @param port To listen at; 0 for any that is free.
  explicit FakeServer(int port = 0);
  FakeServer(const FakeServer&) = delete;
  FakeServer& operator=(const FakeServer&) = delete;
  FakeServer(FakeServer&&) = delete;
  FakeServer& operator=(FakeServer&&) = delete;
  ~FakeServer();

  [[nodiscard]] std::string address() const { return "127.0.0.1:" + std::to_string(port_); }
  [[nodiscard]] int port() const { return port_; }

  /// What it answers.
  std::vector<v1::MatchResponse> events;
  v1::SegmentResponse segments;
  v1::PutSceneResponse put;
  v1::GetSceneResponse got;
  std::vector<v1::ListScenesResponse> scene_pages;
  v1::UpdateSceneResponse updated;
  v1::TransferResponse carried;
  v1::ListAlgorithmsResponse catalogue;
  v1::GetServerInfoResponse info;
  /// Whether a match goes on with its first progress until somebody stops it.
  bool endless = false;
  /// After how many events the link of the next match is lost.
  std::optional<std::size_t> breaks_after;
  /// Whether it knows no match that was begun before.
  bool forgets = false;
  /// What it says of matches that have a name.
  v1::GetMatchResponse record;
  v1::CancelMatchResponse stopped;
  std::vector<v1::ListMatchesResponse> match_pages;

  /// Fails with a status, so many times.
  void fail(const google::rpc::Status& status, int times = 1'000'000);
  void set_serving(bool serving);

  /// Requests so far, in protobuf's text format, with what said who calls.
  std::vector<std::string> requests();
  std::vector<std::string> authorizations();
  /// Waits until a match was stopped by its caller; false if none is for a minute.
  bool wait_until_cancelled();

 private:
  class Matches;
  class Scenes;
  class Transfers;
  class Catalog;

  std::optional<std::size_t> take_break();
  grpc::Status take(const google::protobuf::Message& request, const grpc::ServerContext& context);
  void cancelled();

  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::string> requests_;
  std::vector<std::string> authorizations_;
  bool cancelled_ = false;
  google::rpc::Status error_;
  int fails_ = 0;
  int port_ = 0;
  std::unique_ptr<Matches> matches_;
  std::unique_ptr<Scenes> scenes_;
  std::unique_ptr<Transfers> transfers_;
  std::unique_ptr<Catalog> catalog_;
  std::unique_ptr<grpc::Server> server_;
};

/// The stream of a match: accepted, scenes, progress, one event of a later version, progress,
/// result.
std::vector<v1::MatchResponse> small_match();

/// The stream of the golden messages.
std::vector<v1::MatchResponse> golden_match();

/// A status, perhaps with a reason, and with a time after which to come back.
google::rpc::Status status_of(grpc::StatusCode code, const std::string& message,
                              const std::string& reason = {}, double retry_after = -1.0);

}  // namespace sketchmatch::test
