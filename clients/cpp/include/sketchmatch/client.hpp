/// @file
/// The client.
#pragma once

#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <sketchmatch/catalogue.hpp>
#include <sketchmatch/errors.hpp>
#include <sketchmatch/match.hpp>
#include <sketchmatch/options.hpp>
#include <sketchmatch/scene.hpp>
#include <sketchmatch/sources.hpp>
#include <sketchmatch/stored.hpp>
#include <sketchmatch/summary.hpp>
#include <sketchmatch/transfer.hpp>
#include <string>
#include <vector>

namespace grpc {
class Channel;
class ClientContext;
class Status;
}  // namespace grpc

namespace sketchmatch {

namespace detail {
class MatchStream;
class PendingMatch;
}  // namespace detail

/// A running match, read event by event, as `Client::events` returns it.
///
/// The match starts when the first event is requested. Destroying this object stops the match,
/// unless it is to keep running. One thread reads the events; `cancel` may be called from any
/// other. If the connection is lost or the server restarts, the match continues by itself.
class MatchCall {
 public:
  /// @cond internal
  explicit MatchCall(std::unique_ptr<detail::MatchStream> stream);
  /// @endcond
  /// Takes over the match of another object.
  MatchCall(MatchCall&& other) noexcept;
  /// Takes over the match of another object; the match that was here ends.
  MatchCall& operator=(MatchCall&& other) noexcept;
  MatchCall(const MatchCall&) = delete;
  MatchCall& operator=(const MatchCall&) = delete;
  ~MatchCall();

  /// Waits for the next event and returns it, or nothing at the end of the match. Kinds of events
  /// that only newer servers know are skipped.
  /// @throws SketchmatchError If the match failed; the error says why.
  std::optional<MatchEvent> next();

  /// Waits for the end of the match and returns it.
  /// @param on_progress Called with each progress, by this thread. If it throws, the match ends.
  /// @throws SketchmatchError If the match failed; `CallCancelledError` if it was stopped.
  Match result(const ProgressCallback& on_progress = {});

  /// The number of the last event that the server sent, after which `Client::watch` can continue;
  /// 0 before the first event.
  [[nodiscard]] std::uint64_t last_event() const;

  /// Stops the match, even if it is to keep running: a thread that waits for it gets a
  /// `CallCancelledError`. A match that has ended is not changed.
  void cancel();

 private:
  std::unique_ptr<detail::MatchStream> stream_;
};

/// Functions that are called while a match runs, by a thread of their own; each may be left out. A
/// callback may destroy the `AsyncMatch`.
struct MatchCallbacks {
  ProgressCallback on_progress;                           ///< Called with each progress.
  std::function<void(const Match&)> on_match;             ///< Called with the finished match.
  std::function<void(const SketchmatchError&)> on_error;  ///< Called if the match failed.
};

/// A match that runs in the background, as `Client::match_async` returns it. Destroying this object
/// stops the match, unless it is to keep running, and waits until no callback is running any more.
class AsyncMatch {
 public:
  /// @cond internal
  explicit AsyncMatch(std::shared_ptr<detail::PendingMatch> pending);
  /// @endcond
  /// Takes over the match of another object.
  AsyncMatch(AsyncMatch&& other) noexcept;
  /// Takes over the match of another object; the match that was here ends.
  AsyncMatch& operator=(AsyncMatch&& other) noexcept;
  AsyncMatch(const AsyncMatch&) = delete;
  AsyncMatch& operator=(const AsyncMatch&) = delete;
  ~AsyncMatch();

  /// A future that gets the finished match or its error. It may outlive this object.
  [[nodiscard]] std::shared_future<Match> future() const;

  /// Waits for the end of the match and returns it.
  /// @throws SketchmatchError If the match failed; the error says why.
  [[nodiscard]] Match get() const;

  /// Stops the match: `future` and `on_error` get a `CallCancelledError`.
  void cancel();

 private:
  std::shared_ptr<detail::PendingMatch> pending_;
};

/// A connection to a server; any number of threads may use it at the same time.
///
/// If a call fails, it throws a `SketchmatchError`; there is one class for each possible remedy.
class Client {
 public:
  /// @param address Host and port of the server, e.g. `"localhost:50051"`, or another address as
  ///   gRPC names them, e.g. `"unix:/run/sketchmatch.sock"`. For servers on this machine, proxies
  ///   named in the environment are not used.
  /// @param options Timeout, retries, encryption and tokens.
  /// @throws InvalidRequestError If the address is invalid, a file cannot be read, options
  ///   contradict each other, or others could read the token.
  explicit Client(const std::string& address, const ClientOptions& options = {});
  /// Takes over the connection of another client.
  Client(Client&& other) noexcept;
  /// Takes over the connection of another client; the connection that was here ends.
  Client& operator=(Client&& other) noexcept;
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  ~Client();

  /// Matches a sketch with a map and waits for the answer.
  /// @param sketch What the person drew.
  /// @param map The robot's map.
  /// @param options Profile, algorithms, parameters, seed, time budget …
  /// @param on_progress Called with each progress, by this thread. If it throws, the match ends.
  /// @param call Timeout and cancellation. To get the best match so far instead of an error after
  ///   some time, give a time budget instead of a timeout.
  [[nodiscard]] Match match(const Source& sketch, const Source& map,
                            const MatchOptions& options = {},
                            const ProgressCallback& on_progress = {},
                            const CallOptions& call = {}) const;

  /// Matches a sketch with a map; the caller reads the events one by one.
  [[nodiscard]] MatchCall events(const Source& sketch, const Source& map,
                                 const MatchOptions& options = {},
                                 const CallOptions& call = {}) const;

  /// Matches a sketch with a map in the background, and returns at once.
  [[nodiscard]] AsyncMatch match_async(const Source& sketch, const Source& map,
                                       const MatchOptions& options = {},
                                       MatchCallbacks callbacks = {},
                                       const CallOptions& call = {}) const;

  /// Reads the events of a match that this caller has started before.
  /// @param match_id Its name, from `MatchAccepted`.
  /// @param after The number of the last event that is already known; only later events are read.
  /// @param call Timeout and cancellation.
  /// @throws NotFoundError When events are read: if the server keeps no such match, or it belongs
  ///   to another caller.
  [[nodiscard]] MatchCall watch(const std::string& match_id, std::uint64_t after = 0,
                                const CallOptions& call = {}) const;

  /// Returns the state of a match of this caller, with its events so far.
  /// @throws NotFoundError As `watch`.
  [[nodiscard]] MatchRecord get_match(const std::string& match_id,
                                      const CallOptions& call = {}) const;

  /// Stops a match of this caller, and returns its state. A match that has ended is not changed,
  /// except that an interrupted match becomes cancelled, so that it is not done again.
  /// @throws NotFoundError As `watch`.
  // A caller that cancels a match need not look at its state.
  // NOLINTNEXTLINE(modernize-use-nodiscard)
  MatchSummary cancel_match(const std::string& match_id, const CallOptions& call = {}) const;

  /// Returns the states of all matches of this caller, the latest first. The timeout is for the
  /// whole list.
  [[nodiscard]] std::vector<MatchSummary> matches(const CallOptions& call = {}) const;

  /// Finds the objects of one source, without a match.
  [[nodiscard]] Segmentation segment(const Source& source, const SegmentOptions& options = {},
                                     const CallOptions& call = {}) const;

  /// Finds the objects of a source and stores them on the server for later matches: for their name,
  /// `sources::stored_scene` returns a sketch or map.
  /// @throws StoreError If the server stores no scenes, or cannot do so at present.
  // A caller that knows the name already need not look at the result.
  // NOLINTNEXTLINE(modernize-use-nodiscard)
  PutScene put_scene(const Source& source, const PutOptions& options = {},
                     const CallOptions& call = {}) const;

  /// Returns a scene that this caller has stored.
  /// @param name Its name.
  /// @param include_source Whether to return the source, too, which may be large.
  /// @param call Timeout and cancellation.
  /// @throws NotFoundError If the server has no such scene of this caller.
  [[nodiscard]] GotScene get_scene(const std::string& name, bool include_source = false,
                                   const CallOptions& call = {}) const;

  /// Returns a summary of each scene that this caller has stored, the latest first. The timeout is
  /// for the whole list.
  [[nodiscard]] std::vector<SceneSummary> list_scenes(const CallOptions& call = {}) const;

  /// Gives objects of a stored scene other labels, or the scene another title.
  /// @param name Name of the scene, which itself is not changed.
  /// @param labels New labels by index, from 0; an empty one removes the label.
  /// @param title The new title; an empty one removes the title.
  /// @param call Timeout and cancellation.
  /// @return The scene with these labels, under a name of its own. A title does not change the
  /// name.
  /// @throws NotFoundError As `get_scene`.
  [[nodiscard]] StoredScene update_scene(const std::string& name, const ObjectLabels& labels,
                                         const std::optional<std::string>& title = {},
                                         const CallOptions& call = {}) const;

  /// Deletes a scene for this caller; it remains for other callers who have stored it.
  /// @throws NotFoundError As `get_scene`.
  void delete_scene(const std::string& name, const CallOptions& call = {}) const;

  /// Transfers points, routes and zones from a sketch to a map, from a map to a sketch, or from an
  /// old map (given as `sketch`) to a new one (given as `map`).
  /// @param sketch What the person drew, or the old map.
  /// @param map The robot's map, or the new map.
  /// @param features What is transferred; a route that is drawn in the sketch always is.
  /// @param options Direction, radius, which object is which if that is known, and the options of
  ///   the match.
  /// @param call Timeout and cancellation.
  [[nodiscard]] Transfer transfer(const Source& sketch, const Source& map,
                                  const std::vector<Feature>& features = {},
                                  const TransferOptions& options = {},
                                  const CallOptions& call = {}) const;

  /// Returns the algorithms that the server offers, its profiles, readers and plugins.
  [[nodiscard]] Catalogue algorithms(const CallOptions& call = {}) const;

  /// Returns the server's versions and limits.
  [[nodiscard]] ServerInfo server_info(const CallOptions& call = {}) const;

  /// Returns whether the server, or a part of it, is ready: started and with compiled kernels.
  /// @param name The part: a service, such as "sketchmatch.v1.MatchService", or an algorithm, such
  ///   as "searcher/easm". If left out, the whole server.
  /// @param call Timeout and cancellation.
  /// @throws InvalidRequestError If the server has no such part.
  [[nodiscard]] bool is_serving(const std::string& name = {}, const CallOptions& call = {}) const;

  /// Waits until the server is ready.
  /// @param timeout The longest wait, or infinity for no limit. When a server starts for the first
  ///   time after its installation, it compiles its kernels.
  /// @param cancellation Ends the wait from elsewhere.
  /// @throws ServerUnavailableError If the server is not ready in time.
  void wait_until_serving(Seconds timeout = std::chrono::seconds(60),
                          const Cancellation& cancellation = {}) const;

  /// The channel, for stubs of `<sketchmatch/raw.hpp>` and of other services of the server.
  [[nodiscard]] const std::shared_ptr<grpc::Channel>& channel() const noexcept;

  /// Adds the caller's token to a call of such a stub.
  void authorize(grpc::ClientContext& context) const;

  /// Throws the error of this package for the status of such a call, unless the status is OK.
  void check(const grpc::Status& status) const;

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

}  // namespace sketchmatch
