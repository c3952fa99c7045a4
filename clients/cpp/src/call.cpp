#include "call.hpp"

#include <utility>
#include <variant>

#include "decoding.hpp"

namespace sketchmatch::detail {

void Connection::authorize(grpc::ClientContext& context) const {
  if (!authorization.empty()) {
    context.AddMetadata("authorization", authorization);
  }
}

std::optional<Seconds> Connection::limit(const CallOptions& call) const {
  return call.timeout ? limit_of(*call.timeout) : timeout;
}

struct MatchStream::Attempt {
  Attempt(const Connection& connection, v1::MatchService::Stub& stub, const Course& course,
          const Attempts& attempts, const std::shared_ptr<CancellationState>& cancellation)
      : stop(cancellation, [this] { context.TryCancel(); }) {
    attempts.limit(context);
    connection.authorize(context);
    if (const auto watching = course.watching()) {
      watched = stub.WatchMatch(&context, *watching);
    } else {
      begun = stub.Match(&context, course.request().value());
    }
  }
  Attempt(const Attempt&) = delete;
  Attempt& operator=(const Attempt&) = delete;
  Attempt(Attempt&&) = delete;
  Attempt& operator=(Attempt&&) = delete;
  ~Attempt() {
    if (!finished) {
      context.TryCancel();
      finish();
    }
  }

  /// Reads the next event; false at the end.
  bool read(v1::MatchResponse& event) const {
    if (begun) {
      return begun->Read(&event);
    }
    v1::WatchMatchResponse response;
    const bool is_one = watched->Read(&response);
    event.Swap(response.mutable_event());
    return is_one;
  }

  grpc::Status finish() {
    finished = true;
    return begun ? begun->Finish() : watched->Finish();
  }

  grpc::ClientContext context;
  OnCancel stop;
  // One of these.
  std::unique_ptr<grpc::ClientReader<v1::MatchResponse>> begun;
  std::unique_ptr<grpc::ClientReader<v1::WatchMatchResponse>> watched;
  bool finished = false;
};

MatchStream::MatchStream(std::shared_ptr<const Connection> connection, Course course,
                         const CallOptions& call)
    : connection_(std::move(connection)),
      stub_(v1::MatchService::NewStub(connection_->channel)),
      course_(std::move(course)),
      limit_(connection_->limit(call)),
      own_(std::make_shared<CancellationState>()),
      callers_(call.cancellation.state(), [this] { cancel(); }) {}

MatchStream::~MatchStream() { stop_what_keeps_running(); }

std::optional<MatchEvent> MatchStream::next() {
  while (const auto message = read()) {
    if (auto event = decoded(*message)) {
      keep(*event);
      return event;
    }
  }
  return std::nullopt;
}

Match MatchStream::result(const ProgressCallback& on_progress) {
  while (const auto event = next()) {
    if (const auto* progress = std::get_if<Progress>(&*event); progress != nullptr && on_progress) {
      on_progress(*progress);
    }
  }
  if (!has_result_) {
    throw ServerFailedError("the server ended the match without a result; send it again");
  }
  return match_;
}

void MatchStream::keep(const MatchEvent& event) {
  if (const auto* accepted = std::get_if<MatchAccepted>(&event)) {
    match_.accepted = *accepted;
  } else if (const auto* scenes = std::get_if<MatchScenes>(&event)) {
    match_.scenes = *scenes;
  } else if (const auto* result = std::get_if<MatchResult>(&event)) {
    match_.result = *result;
    has_result_ = true;
  }
}

std::optional<v1::MatchResponse> MatchStream::read() {
  if (!attempts_) {
    attempts_.emplace(connection_->retries, limit_);
  }
  while (!ended_) {
    if (!attempt_) {
      attempt_ = std::make_unique<Attempt>(*connection_, *stub_, course_, *attempts_, own_);
    }
    v1::MatchResponse message;
    if (attempt_->read(message)) {
      attempts_->succeeded();
      if (course_.take(message)) {
        return message;
      }
      continue;
    }
    const grpc::Status status = attempt_->finish();
    attempt_.reset();
    if (status.ok()) {
      ended_ = true;
      break;
    }
    const auto failure = failure_of(status, connection_->address);
    if (course_.ends(failure)) {
      ended_ = true;
    } else if (const auto pause = course_.pause_after(failure, *attempts_)) {
      own_->wait_for(*pause);
    } else {
      end(failure);
    }
  }
  if (failure_) {
    failure_->raise();
  }
  return std::nullopt;
}

void MatchStream::end(Failure failure) {
  if (own_->cancelled() && failure.kind == Failure::Kind::cancelled) {
    failure.message = "the match was cancelled before its end";
  }
  stop_what_keeps_running();
  ended_ = true;
  failure_ = std::move(failure);
}

void MatchStream::stop_what_keeps_running() {
  constexpr std::chrono::seconds kCancelling{10};
  const auto& request = course_.request();
  if (!cancelled_ || ended_ || course_.match_id().empty() ||
      (request && !request->keep_running())) {
    return;
  }
  grpc::ClientContext context;
  Attempts(0, kCancelling).limit(context);
  connection_->authorize(context);
  v1::CancelMatchRequest cancel;
  cancel.set_match_id(course_.match_id());
  v1::CancelMatchResponse answer;
  // Whether it heard, the match itself tells.
  static_cast<void>(stub_->CancelMatch(&context, cancel, &answer));
}

}  // namespace sketchmatch::detail
