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

/// A match that a server is doing, event by event, as `Client::events` returns it.
///
/// It starts when the first event is asked for; dropping it stops it, unless it is to keep running.
/// One thread goes through the events; `cancel` may be called from any other. When the link is lost
/// or the server starts anew, it goes on by itself.
class MatchCall {
 public:
  /// @cond internal
  explicit MatchCall(std::unique_ptr<detail::MatchStream> stream);
  /// @endcond
  /// Takes the call of another.
  MatchCall(MatchCall&& other) noexcept;
  /// Takes the call of another; what was here ends.
  MatchCall& operator=(MatchCall&& other) noexcept;
  MatchCall(const MatchCall&) = delete;
  MatchCall& operator=(const MatchCall&) = delete;
  ~MatchCall();

  /// Waits for the next event and returns it; none at the end. Events of a kind that only newer
  /// servers know are left out.
  /// @throws SketchmatchError What ended the match before.
  std::optional<MatchEvent> next();

  /// Waits for the end of the match and returns it.
  /// @param on_progress Called with each progress, by this thread. What it throws ends the match.
  /// @throws SketchmatchError What ended the match before; `CallCancelledError` if it was stopped.
  Match result(const ProgressCallback& on_progress = {});

  /// The number of the last event that the server told, with which `Client::watch` goes on; 0
  /// before there is any.
  [[nodiscard]] std::uint64_t last_event() const;

  /// Stops the match, also one that is to keep running: whoever waits for it gets a
  /// `CallCancelledError`. One that has ended stays as it is.
  void cancel();

 private:
  std::unique_ptr<detail::MatchStream> stream_;
};

/// What is called while a match runs, by a thread of its own; each may be left out. A callback may
/// drop the `AsyncMatch`.
struct MatchCallbacks {
  ProgressCallback on_progress;                           ///< With each progress.
  std::function<void(const Match&)> on_match;             ///< With the match, once it is done.
  std::function<void(const SketchmatchError&)> on_error;  ///< With what ended it before.
};

/// A match that runs beside, as `Client::match_async` returns it. Dropping it stops the match,
/// unless it is to keep running, and waits until no callback runs any more.
class AsyncMatch {
 public:
  /// @cond internal
  explicit AsyncMatch(std::shared_ptr<detail::PendingMatch> pending);
  /// @endcond
  /// Takes the match of another.
  AsyncMatch(AsyncMatch&& other) noexcept;
  /// Takes the match of another; what was here ends.
  AsyncMatch& operator=(AsyncMatch&& other) noexcept;
  AsyncMatch(const AsyncMatch&) = delete;
  AsyncMatch& operator=(const AsyncMatch&) = delete;
  ~AsyncMatch();

  /// What holds the match, or the error that ended it, when it is over. It may outlive this.
  [[nodiscard]] std::shared_future<Match> future() const;

  /// Waits for the end of the match and returns it.
  /// @throws SketchmatchError What ended the match before.
  [[nodiscard]] Match get() const;

  /// Stops the match: `future` and `on_error` get a `CallCancelledError`.
  void cancel();

 private:
  std::shared_ptr<detail::PendingMatch> pending_;
};

/// A connection to a server; any number of threads may use it at the same time.
///
/// Every call throws a `SketchmatchError`, of which there is one class for each thing to do.
class Client {
 public:
  /// @param address Host and port of the server, e.g. `"localhost:50051"`, or another address as
  ///   gRPC names them, e.g. `"unix:/run/sketchmatch.sock"`. Proxies that the environment names are
  ///   not asked for what is on this machine.
  /// @param options Timeout, retries, encryption and tokens.
  /// @throws InvalidRequestError If the address is none, a file cannot be read, parts contradict
  ///   each other, or others could read the token.
  explicit Client(const std::string& address, const ClientOptions& options = {});
  /// Takes the connection of another.
  Client(Client&& other) noexcept;
  /// Takes the connection of another; what was here ends.
  Client& operator=(Client&& other) noexcept;
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  ~Client();

  /// Matches a sketch with a map and waits for the answer.
  /// @param sketch What the person drew.
  /// @param map What the robot knows.
  /// @param options Profile, algorithms, parameters, seed, time budget …
  /// @param on_progress Called with each progress, by this thread. What it throws ends the match.
  /// @param call Timeout and cancellation. To have the best match until then instead of an error,
  ///   give a time budget.
  [[nodiscard]] Match match(const Source& sketch, const Source& map,
                            const MatchOptions& options = {},
                            const ProgressCallback& on_progress = {},
                            const CallOptions& call = {}) const;

  /// Matches a sketch with a map, event by event.
  [[nodiscard]] MatchCall events(const Source& sketch, const Source& map,
                                 const MatchOptions& options = {},
                                 const CallOptions& call = {}) const;

  /// Matches a sketch with a map in a thread of its own, and returns at once.
  [[nodiscard]] AsyncMatch match_async(const Source& sketch, const Source& map,
                                       const MatchOptions& options = {},
                                       MatchCallbacks callbacks = {},
                                       const CallOptions& call = {}) const;

  /// Reads a match of one's own that was begun before, event by event.
  /// @param match_id Its name, as `MatchAccepted` has it.
  /// @param after The number of the last event that is known already; `MatchCall::result` holds
  ///   those after it.
  /// @param call Timeout and cancellation.
  /// @throws NotFoundError By the call: if the server keeps no such match, or it is another
  /// caller's.
  [[nodiscard]] MatchCall watch(const std::string& match_id, std::uint64_t after = 0,
                                const CallOptions& call = {}) const;

  /// Returns how a match of one's own is, with its events so far.
  /// @throws NotFoundError As `watch`.
  [[nodiscard]] MatchRecord get_match(const std::string& match_id,
                                      const CallOptions& call = {}) const;

  /// Stops a match of one's own, and returns how it is. One that has ended stays as it is, but one
  /// that was interrupted is cancelled, and so not done again.
  /// @throws NotFoundError As `watch`.
  // Whoever cancels need not ask how the match ended.
  // NOLINTNEXTLINE(modernize-use-nodiscard)
  MatchSummary cancel_match(const std::string& match_id, const CallOptions& call = {}) const;

  /// Returns how all matches of one's own are, the latest first. The timeout is for all of it.
  [[nodiscard]] std::vector<MatchSummary> matches(const CallOptions& call = {}) const;

  /// Finds the objects of one source, without a match.
  [[nodiscard]] Segmentation segment(const Source& source, const SegmentOptions& options = {},
                                     const CallOptions& call = {}) const;

  /// Finds the objects of a source, and has the server keep them for later matches:
  /// `sources::stored_scene` makes their name a sketch or map.
  /// @throws StoreError If the server keeps no scenes, or cannot.
  // Whoever knows the name already need not look.
  // NOLINTNEXTLINE(modernize-use-nodiscard)
  PutScene put_scene(const Source& source, const PutOptions& options = {},
                     const CallOptions& call = {}) const;

  /// Returns a scene that one has put.
  /// @param name Its name.
  /// @param include_source Whether the source is wanted, too; it may be large.
  /// @param call Timeout and cancellation.
  /// @throws NotFoundError If the server keeps no such scene for this caller.
  [[nodiscard]] GotScene get_scene(const std::string& name, bool include_source = false,
                                   const CallOptions& call = {}) const;

  /// Returns what there is to say of all scenes that one has put, the latest first. The timeout is
  /// for all of it.
  [[nodiscard]] std::vector<SceneSummary> list_scenes(const CallOptions& call = {}) const;

  /// Gives objects of a kept scene other labels, or the scene another title.
  /// @param name Of the scene, which stays as it is.
  /// @param labels By index, from 0; an empty one takes the label away.
  /// @param title What you call it from now on; an empty one takes the title away.
  /// @param call Timeout and cancellation.
  /// @return The scene with these labels, under its own name, which a title does not change.
  /// @throws NotFoundError As `get_scene`.
  [[nodiscard]] StoredScene update_scene(const std::string& name, const ObjectLabels& labels,
                                         const std::optional<std::string>& title = {},
                                         const CallOptions& call = {}) const;

  /// Forgets a scene; it stays for others who have put it.
  /// @throws NotFoundError As `get_scene`.
  void delete_scene(const std::string& name, const CallOptions& call = {}) const;

  /// Carries points, routes and zones from a sketch to a map, back, or from an old map to a new
  /// one, which is then given as the map.
  /// @param sketch What the person drew, or the old map.
  /// @param map What the robot knows.
  /// @param features What is carried; a route that is drawn in the sketch is, without being asked.
  /// @param options Which object is which, where that is known, direction, radius, and all that a
  ///   match takes but what is about its name.
  /// @param call Timeout and cancellation.
  [[nodiscard]] Transfer transfer(const Source& sketch, const Source& map,
                                  const std::vector<Feature>& features = {},
                                  const TransferOptions& options = {},
                                  const CallOptions& call = {}) const;

  /// Returns the algorithms that the server offers, its profiles, readers and plugins.
  [[nodiscard]] Catalogue algorithms(const CallOptions& call = {}) const;

  /// Returns the server's versions and limits.
  [[nodiscard]] ServerInfo server_info(const CallOptions& call = {}) const;

  /// Returns whether the server, or a part of it, is up and warm.
  /// @param name The part: a service, as in "sketchmatch.v1.MatchService", or an algorithm, as in
  ///   "searcher/easm". The whole server when left out.
  /// @param call Timeout and cancellation.
  /// @throws InvalidRequestError If the server has no such part.
  [[nodiscard]] bool is_serving(const std::string& name = {}, const CallOptions& call = {}) const;

  /// Waits until the server is up and warm.
  /// @param timeout How long at most; infinity for no limit. A server's first ever start compiles
  ///   its kernels.
  /// @param cancellation What ends the wait from elsewhere.
  /// @throws ServerUnavailableError If it does not serve by then.
  void wait_until_serving(Seconds timeout = std::chrono::seconds(60),
                          const Cancellation& cancellation = {}) const;

  /// The channel, for stubs of `<sketchmatch/raw.hpp>` and of other services of the server.
  [[nodiscard]] const std::shared_ptr<grpc::Channel>& channel() const noexcept;

  /// Adds to a call of such a stub what says who calls.
  void authorize(grpc::ClientContext& context) const;

  /// Throws the error of this package that such a call's status is; nothing if it is OK.
  void check(const grpc::Status& status) const;

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

}  // namespace sketchmatch
