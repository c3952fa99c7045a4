/// @file
/// Calls: what they have in common, and a match as a stream of events.
#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <sketchmatch/v1/match_service.grpc.pb.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <sketchmatch/match.hpp>
#include <sketchmatch/options.hpp>
#include <string>

#include "attempts.hpp"
#include "cancellation_state.hpp"
#include "course.hpp"
#include "statuses.hpp"

namespace sketchmatch::detail {

/// A connection, and what all its calls share.
struct Connection {
  std::string address;
  std::string authorization;
  std::optional<Seconds> timeout;
  int retries = 0;
  std::shared_ptr<grpc::Channel> channel;

  /// Adds the caller's token.
  void authorize(grpc::ClientContext& context) const;

  /// Returns how long a call may take.
  [[nodiscard]] std::optional<Seconds> limit(const CallOptions& call) const;
};

/// Makes a call, repeats it if that helps, and returns its answer.
/// @param ask Called with a context and an answer to fill; returns the status.
template <typename Answer, typename Ask>
Answer asked(const Connection& connection, const CallOptions& call, const Ask& ask) {
  Attempts attempts(connection.retries, connection.limit(call));
  while (true) {
    Failure failure;
    {
      grpc::ClientContext context;
      attempts.limit(context);
      connection.authorize(context);
      const OnCancel stop(call.cancellation.state(), [&context] { context.TryCancel(); });
      Answer answer;
      const grpc::Status status = ask(&context, &answer);
      if (status.ok()) {
        return answer;
      }
      failure = failure_of(status, connection.address);
    }
    const auto pause = attempts.pause_after(failure);
    if (!pause) {
      failure.raise();
    }
    call.cancellation.state()->wait_for(*pause);
  }
}

/// A running match.
class MatchStream {
 public:
  MatchStream(std::shared_ptr<const Connection> connection, Course course, const CallOptions& call);
  MatchStream(const MatchStream&) = delete;
  MatchStream& operator=(const MatchStream&) = delete;
  MatchStream(MatchStream&&) = delete;
  MatchStream& operator=(MatchStream&&) = delete;
  ~MatchStream();

  /// Returns the next event, or nothing at the end.
  std::optional<MatchEvent> next();

  /// Waits for the end.
  Match result(const ProgressCallback& on_progress);

  /// The number of the last event that the server sent.
  [[nodiscard]] std::uint64_t last_event() const { return course_.after(); }

  /// Stops the match, even if it is to keep running; any thread may call this.
  void cancel() {
    cancelled_ = true;
    own_->cancel();
  }

  /// Stops reading it; any thread may call this.
  void leave() { own_->cancel(); }

 private:
  /// One attempt, which is stopped when it is left.
  struct Attempt;

  std::optional<v1::MatchResponse> read();
  void end(Failure failure);
  void stop_what_keeps_running();
  void keep(const MatchEvent& event);

  std::shared_ptr<const Connection> connection_;
  std::unique_ptr<v1::MatchService::Stub> stub_;
  Course course_;
  std::optional<Seconds> limit_;
  std::atomic<bool> cancelled_ = false;
  std::shared_ptr<CancellationState> own_;
  OnCancel callers_;
  std::optional<Attempts> attempts_;
  std::unique_ptr<Attempt> attempt_;
  bool ended_ = false;
  std::optional<Failure> failure_;
  Match match_;
  bool has_result_ = false;
};

}  // namespace sketchmatch::detail
