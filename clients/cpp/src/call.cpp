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
  Attempt(const Connection& connection, v1::MatchService::Stub& stub,
          const v1::MatchRequest& request, const Attempts& attempts,
          const std::shared_ptr<CancellationState>& cancellation)
      : stop(cancellation, [this] { context.TryCancel(); }) {
    attempts.limit(context);
    connection.authorize(context);
    reader = stub.Match(&context, request);
  }
  Attempt(const Attempt&) = delete;
  Attempt& operator=(const Attempt&) = delete;
  Attempt(Attempt&&) = delete;
  Attempt& operator=(Attempt&&) = delete;
  ~Attempt() {
    if (!finished) {
      context.TryCancel();
      reader->Finish();
    }
  }

  grpc::ClientContext context;
  OnCancel stop;
  std::unique_ptr<grpc::ClientReader<v1::MatchResponse>> reader;
  bool finished = false;
};

MatchStream::MatchStream(std::shared_ptr<const Connection> connection, v1::MatchRequest request,
                         const CallOptions& call)
    : connection_(std::move(connection)),
      stub_(v1::MatchService::NewStub(connection_->channel)),
      request_(std::move(request)),
      limit_(connection_->limit(call)),
      own_(std::make_shared<CancellationState>()),
      callers_(call.cancellation.state(), [own = own_] { own->cancel(); }) {}

MatchStream::~MatchStream() = default;

std::optional<MatchEvent> MatchStream::next() {
  while (const auto message = read()) {
    told_ = true;
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
      attempt_ = std::make_unique<Attempt>(*connection_, *stub_, request_, *attempts_, own_);
    }
    v1::MatchResponse message;
    if (attempt_->reader->Read(&message)) {
      return message;
    }
    const grpc::Status status = attempt_->reader->Finish();
    attempt_->finished = true;
    attempt_.reset();
    if (status.ok()) {
      ended_ = true;
      break;
    }
    failure_ = failure_of(status, connection_->address);
    if (own_->cancelled() && failure_->kind == Failure::Kind::cancelled) {
      failure_->message = "the match was cancelled before its end";
    }
    const auto pause = told_ ? std::nullopt : attempts_->pause_after(*failure_);
    if (pause) {
      own_->wait_for(*pause);
      failure_.reset();
    } else {
      ended_ = true;
    }
  }
  if (failure_) {
    failure_->raise();
  }
  return std::nullopt;
}

}  // namespace sketchmatch::detail
