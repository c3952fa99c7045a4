#include <grpcpp/create_channel.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/support/byte_buffer.h>
#include <sketchmatch/v1/catalog_service.grpc.pb.h>
#include <sketchmatch/v1/scene_service.grpc.pb.h>
#include <sketchmatch/v1/transfer_service.grpc.pb.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <limits>
#include <sketchmatch/client.hpp>
#include <thread>
#include <utility>

#include "access.hpp"
#include "address.hpp"
#include "call.hpp"
#include "decoding.hpp"
#include "requests.hpp"
#include "text.hpp"

namespace sketchmatch {

namespace {

// The standard health service, by hand: its request is one text, its response one enum (both field
// 1). A program may hold its messages once, and may have them from elsewhere.
constexpr const char* kCheckHealth = "/grpc.health.v1.Health/Check";
constexpr const char* kServing = "\x08\x01";
constexpr std::size_t kLongestName = 127;
constexpr Seconds kHealthPoll{0.05};

using Clock = std::chrono::steady_clock;

/// Returns how to make the next of several calls that share a time.
CallOptions what_is_left(const CallOptions& call, std::optional<Seconds> limit,
                         Clock::time_point began) {
  auto next = call;
  next.timeout = limit ? std::max(Seconds(0.0), *limit - Seconds(Clock::now() - began))
                       : Seconds(std::numeric_limits<double>::infinity());
  return next;
}

[[noreturn]] void refuse_part(const std::string& name) {
  detail::refuse("name", "is " + detail::in_quotes(name) +
                             ", which the server does not have; name a service, as in "
                             "sketchmatch.v1.MatchService, or an algorithm, as in searcher/easm");
}

grpc::ByteBuffer health_request(const std::string& name) {
  if (name.size() > kLongestName || !detail::is_utf8(name)) {
    refuse_part(name);
  }
  std::string message;
  if (!name.empty()) {
    message = std::string("\x0a") + static_cast<char>(name.size()) + name;
  }
  const grpc::Slice slice(message);
  return {&slice, 1};
}

std::string bytes_of(const grpc::ByteBuffer& buffer) {
  grpc::Slice slice;
  if (!buffer.DumpToSingleSlice(&slice).ok()) {
    return {};
  }
  // gRPC has bytes where we have characters.
  return {reinterpret_cast<const char*>(slice.begin()), slice.size()};  // NOLINT
}

/// Makes a call with bytes for messages.
grpc::Status ask(const std::shared_ptr<grpc::Channel>& channel, const char* method,
                 grpc::ClientContext* context, const grpc::ByteBuffer& request,
                 grpc::ByteBuffer* answer) {
  grpc::CompletionQueue queue;
  grpc::GenericStub stub(channel);
  grpc::Status status;
  const auto reader = stub.PrepareUnaryCall(context, method, request, &queue);
  reader->StartCall();
  reader->Finish(answer, &status, nullptr);
  void* tag = nullptr;
  bool ok = false;
  queue.Next(&tag, &ok);
  queue.Shutdown();
  while (queue.Next(&tag, &ok)) {
  }
  return status;
}

grpc::ChannelArguments channel_arguments(const std::string& address, const detail::Access& access) {
  grpc::ChannelArguments arguments;
  // The server decides which answers are too large: only it knows its memory.
  arguments.SetMaxSendMessageSize(-1);
  arguments.SetMaxReceiveMessageSize(-1);
  // Buffer as little as possible: the server can no longer replace progress that waits here for a
  // slow reader by the latest. A whole message still passes at once.
  arguments.SetInt("grpc.http2.lookahead_bytes", 1);
  arguments.SetInt("grpc.http2.bdp_probe", 0);
  // A robot's connection may be lost silently: detect this within 40 s, and reconnect soon.
  arguments.SetInt("grpc.keepalive_time_ms", 30'000);
  arguments.SetInt("grpc.keepalive_timeout_ms", 10'000);
  arguments.SetInt("grpc.http2.ping_timeout_ms", 10'000);
  arguments.SetInt("grpc.initial_reconnect_backoff_ms", 100);
  arguments.SetInt("grpc.max_reconnect_backoff_ms", 5'000);
  if (detail::is_here(address)) {
    // A proxy from http_proxy cannot reach the client's own machine.
    arguments.SetInt("grpc.enable_http_proxy", 0);
  }
  if (access.server_name) {
    arguments.SetSslTargetNameOverride(*access.server_name);
  }
  return arguments;
}

}  // namespace

namespace detail {

/// A match in a thread of its own.
class PendingMatch {
 public:
  PendingMatch(std::unique_ptr<MatchStream> stream, MatchCallbacks callbacks)
      : stream_(std::move(stream)), callbacks_(std::move(callbacks)) {}

  static std::shared_ptr<PendingMatch> started(std::unique_ptr<MatchStream> stream,
                                               MatchCallbacks callbacks) {
    auto pending = std::make_shared<PendingMatch>(std::move(stream), std::move(callbacks));
    pending->thread_ = std::thread([pending] { pending->run(); });
    return pending;
  }

  [[nodiscard]] const std::shared_future<Match>& future() const { return future_; }

  void cancel() { stream_->cancel(); }

  /// Leaves the match, and waits for the end of its thread, unless it is called by that thread.
  void end() {
    stream_->leave();
    if (thread_.get_id() == std::this_thread::get_id()) {
      thread_.detach();
    } else {
      thread_.join();
    }
  }

 private:
  void run() {
    try {
      promise_.set_value(told());
    } catch (...) {  // of a callback, too
      promise_.set_exception(std::current_exception());
    }
  }

  Match told() {
    try {
      Match match = stream_->result(callbacks_.on_progress);
      if (callbacks_.on_match) {
        callbacks_.on_match(match);
      }
      return match;
    } catch (const SketchmatchError& error) {
      if (callbacks_.on_error) {
        callbacks_.on_error(error);
      }
      throw;
    }
  }

  std::unique_ptr<MatchStream> stream_;
  MatchCallbacks callbacks_;
  std::promise<Match> promise_;
  std::shared_future<Match> future_{promise_.get_future()};
  std::thread thread_;
};

}  // namespace detail

MatchCall::MatchCall(std::unique_ptr<detail::MatchStream> stream) : stream_(std::move(stream)) {}
MatchCall::MatchCall(MatchCall&& other) noexcept = default;
MatchCall& MatchCall::operator=(MatchCall&& other) noexcept = default;
MatchCall::~MatchCall() = default;

std::optional<MatchEvent> MatchCall::next() { return stream_->next(); }

Match MatchCall::result(const ProgressCallback& on_progress) {
  return stream_->result(on_progress);
}

std::uint64_t MatchCall::last_event() const { return stream_->last_event(); }

void MatchCall::cancel() { stream_->cancel(); }

AsyncMatch::AsyncMatch(std::shared_ptr<detail::PendingMatch> pending)
    : pending_(std::move(pending)) {}

AsyncMatch::AsyncMatch(AsyncMatch&& other) noexcept = default;

AsyncMatch& AsyncMatch::operator=(AsyncMatch&& other) noexcept {
  const AsyncMatch ended(std::exchange(pending_, std::move(other.pending_)));
  return *this;
}

AsyncMatch::~AsyncMatch() {
  if (pending_) {
    pending_->end();
  }
}

std::shared_future<Match> AsyncMatch::future() const { return pending_->future(); }

Match AsyncMatch::get() const { return pending_->future().get(); }

void AsyncMatch::cancel() { pending_->cancel(); }

struct Client::Impl {
  std::shared_ptr<const detail::Connection> connection;
  std::unique_ptr<v1::MatchService::Stub> matches;
  std::unique_ptr<v1::SceneService::Stub> scenes;
  std::unique_ptr<v1::TransferService::Stub> transfers;
  std::unique_ptr<v1::CatalogService::Stub> catalog;

  [[nodiscard]] std::unique_ptr<detail::MatchStream> stream(const Source& sketch, const Source& map,
                                                            const MatchOptions& options,
                                                            const CallOptions& call) const {
    return std::make_unique<detail::MatchStream>(
        connection, detail::Course(detail::match_request(sketch, map, options)), call);
  }

  /// Makes a call of a stub, and returns its answer.
  template <typename Stub, typename Request, typename Answer>
  [[nodiscard]] Answer asked(const CallOptions& call, const std::unique_ptr<Stub>& stub,
                             grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&,
                                                          Answer*),
                             const Request& request) const {
    return detail::asked<Answer>(*connection, call,
                                 [&](grpc::ClientContext* context, Answer* answer) {
                                   return (stub.get()->*method)(context, request, answer);
                                 });
  }

  /// Returns the entries of all pages of a list. The timeout is for all of them.
  template <typename Value, typename Stub, typename Request, typename Page, typename Entries>
  [[nodiscard]] std::vector<Value> all_pages(const CallOptions& call,
                                             const std::unique_ptr<Stub>& stub,
                                             grpc::Status (Stub::*method)(grpc::ClientContext*,
                                                                          const Request&, Page*),
                                             const Entries& (Page::*entries)() const) const {
    const auto limit = connection->limit(call);
    const auto began = Clock::now();
    Request request;
    std::vector<Value> values;
    while (true) {
      const auto page = asked(what_is_left(call, limit, began), stub, method, request);
      for (const auto& entry : (page.*entries)()) {
        values.push_back(detail::decoded(entry));
      }
      if (page.next_page_token().empty()) {
        return values;
      }
      request.set_page_token(page.next_page_token());
    }
  }
};

Client::Client(const std::string& address, const ClientOptions& options) {
  const auto access = detail::access_to(address, options);
  if (options.retries < 0) {
    detail::refuse("retries", "is " + std::to_string(options.retries) +
                                  "; give how often a request may be sent again, at least 0");
  }
  const auto timeout = options.timeout ? detail::limit_of(*options.timeout) : std::nullopt;
  auto channel = grpc::CreateCustomChannel(
      address, access.credentials ? access.credentials : grpc::InsecureChannelCredentials(),
      channel_arguments(address, access));
  impl_ = std::make_shared<const Impl>(
      Impl{std::make_shared<const detail::Connection>(detail::Connection{
               address, access.authorization, timeout, options.retries, channel}),
           v1::MatchService::NewStub(channel), v1::SceneService::NewStub(channel),
           v1::TransferService::NewStub(channel), v1::CatalogService::NewStub(channel)});
}

Client::Client(Client&& other) noexcept = default;
Client& Client::operator=(Client&& other) noexcept = default;
Client::~Client() = default;

Match Client::match(const Source& sketch, const Source& map, const MatchOptions& options,
                    const ProgressCallback& on_progress, const CallOptions& call) const {
  return impl_->stream(sketch, map, options, call)->result(on_progress);
}

MatchCall Client::events(const Source& sketch, const Source& map, const MatchOptions& options,
                         const CallOptions& call) const {
  return MatchCall(impl_->stream(sketch, map, options, call));
}

AsyncMatch Client::match_async(const Source& sketch, const Source& map, const MatchOptions& options,
                               MatchCallbacks callbacks, const CallOptions& call) const {
  return AsyncMatch(detail::PendingMatch::started(impl_->stream(sketch, map, options, call),
                                                  std::move(callbacks)));
}

MatchCall Client::watch(const std::string& match_id, std::uint64_t after,
                        const CallOptions& call) const {
  return MatchCall(std::make_unique<detail::MatchStream>(impl_->connection,
                                                         detail::Course(match_id, after), call));
}

MatchRecord Client::get_match(const std::string& match_id, const CallOptions& call) const {
  v1::GetMatchRequest request;
  request.set_match_id(detail::checked_text(match_id, "match_id"));
  return detail::decoded(
      impl_->asked(call, impl_->matches, &v1::MatchService::Stub::GetMatch, request));
}

MatchSummary Client::cancel_match(const std::string& match_id, const CallOptions& call) const {
  v1::CancelMatchRequest request;
  request.set_match_id(detail::checked_text(match_id, "match_id"));
  const auto answer =
      impl_->asked(call, impl_->matches, &v1::MatchService::Stub::CancelMatch, request);
  return detail::decoded(answer.match());
}

std::vector<MatchSummary> Client::matches(const CallOptions& call) const {
  return impl_->all_pages<MatchSummary>(call, impl_->matches, &v1::MatchService::Stub::ListMatches,
                                        &v1::ListMatchesResponse::matches);
}

Segmentation Client::segment(const Source& source, const SegmentOptions& options,
                             const CallOptions& call) const {
  const auto request = detail::segment_request(source, options);
  return detail::decoded(
      impl_->asked(call, impl_->scenes, &v1::SceneService::Stub::Segment, request));
}

PutScene Client::put_scene(const Source& source, const PutOptions& options,
                           const CallOptions& call) const {
  const auto request = detail::put_scene_request(source, options);
  return detail::decoded(
      impl_->asked(call, impl_->scenes, &v1::SceneService::Stub::PutScene, request));
}

GotScene Client::get_scene(const std::string& name, bool include_source,
                           const CallOptions& call) const {
  v1::GetSceneRequest request;
  request.set_name(detail::checked_text(name, "name"));
  request.set_include_source(include_source);
  return detail::decoded(
      impl_->asked(call, impl_->scenes, &v1::SceneService::Stub::GetScene, request));
}

std::vector<SceneSummary> Client::list_scenes(const CallOptions& call) const {
  return impl_->all_pages<SceneSummary>(call, impl_->scenes, &v1::SceneService::Stub::ListScenes,
                                        &v1::ListScenesResponse::scenes);
}

StoredScene Client::update_scene(const std::string& name, const ObjectLabels& labels,
                                 const std::optional<std::string>& title,
                                 const CallOptions& call) const {
  const auto request = detail::update_scene_request(name, labels, title);
  const auto answer =
      impl_->asked(call, impl_->scenes, &v1::SceneService::Stub::UpdateScene, request);
  return detail::decoded(answer.stored_scene());
}

void Client::delete_scene(const std::string& name, const CallOptions& call) const {
  v1::DeleteSceneRequest request;
  request.set_name(detail::checked_text(name, "name"));
  int sent = 0;
  try {
    static_cast<void>(detail::asked<v1::DeleteSceneResponse>(
        *impl_->connection, call,
        [&](grpc::ClientContext* context, v1::DeleteSceneResponse* answer) {
          ++sent;
          return impl_->scenes->DeleteScene(context, request, answer);
        }));
  } catch (const NotFoundError&) {
    if (sent == 1) {
      throw;
    }
    // An earlier request has deleted it, but its answer was lost.
  }
}

Transfer Client::transfer(const Source& sketch, const Source& map,
                          const std::vector<Feature>& features, const TransferOptions& options,
                          const CallOptions& call) const {
  const auto request = detail::transfer_request(sketch, map, features, options);
  return detail::decoded(
      impl_->asked(call, impl_->transfers, &v1::TransferService::Stub::Transfer, request));
}

Catalogue Client::algorithms(const CallOptions& call) const {
  return detail::decoded(impl_->asked(call, impl_->catalog,
                                      &v1::CatalogService::Stub::ListAlgorithms,
                                      v1::ListAlgorithmsRequest()));
}

ServerInfo Client::server_info(const CallOptions& call) const {
  return detail::decoded(impl_->asked(
      call, impl_->catalog, &v1::CatalogService::Stub::GetServerInfo, v1::GetServerInfoRequest()));
}

bool Client::is_serving(const std::string& name, const CallOptions& call) const {
  const auto request = health_request(name);
  grpc::ClientContext context;
  detail::Attempts(0, impl_->connection->limit(call)).limit(context);
  authorize(context);
  const detail::OnCancel stop(call.cancellation.state(), [&context] { context.TryCancel(); });
  grpc::ByteBuffer answer;
  const auto status = ask(channel(), kCheckHealth, &context, request, &answer);
  if (status.error_code() == grpc::StatusCode::NOT_FOUND) {
    refuse_part(name);
  }
  check(status);
  return bytes_of(answer) == kServing;
}

void Client::wait_until_serving(Seconds timeout, const Cancellation& cancellation) const {
  const auto limit = detail::limit_of(timeout);
  const auto began = Clock::now();
  CallOptions call;
  call.cancellation = cancellation;
  while (true) {
    try {
      if (is_serving({}, what_is_left(call, limit, began))) {
        return;
      }
    } catch (const ServerUnavailableError&) {  // yet
    } catch (const DeadlineExceededError&) {   // as below
    }
    if (limit && Seconds(Clock::now() - began) >= *limit) {
      throw ServerUnavailableError("the sketchmatch server at " + impl_->connection->address +
                                   " did not serve within " + detail::shown(timeout.count()) +
                                   " s; start it, check the address, or wait longer");
    }
    cancellation.state()->wait_for(kHealthPoll);
  }
}

const std::shared_ptr<grpc::Channel>& Client::channel() const noexcept {
  return impl_->connection->channel;
}

void Client::authorize(grpc::ClientContext& context) const {
  impl_->connection->authorize(context);
}

void Client::check(const grpc::Status& status) const {
  if (!status.ok()) {
    detail::failure_of(status, impl_->connection->address).raise();
  }
}

}  // namespace sketchmatch
