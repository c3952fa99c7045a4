/// @file
/// The course of a match as its reader sees it: one stream, even if connections are lost.
#pragma once

#include <sketchmatch/v1/match_service.pb.h>

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <sketchmatch/errors.hpp>
#include <string>

#include "attempts.hpp"
#include "statuses.hpp"

namespace sketchmatch::detail {

/// What is known of a match that is read, and thus how to continue after a lost connection.
class Course {
 public:
  /// A match that is to begin; its request is given a name if it has none.
  explicit Course(v1::MatchRequest request);
  /// A match that has begun, to be read after an event that is already known.
  Course(const std::string& match_id, std::uint64_t after);

  /// The request that begins the match; none if it is only watched.
  [[nodiscard]] const std::optional<v1::MatchRequest>& request() const { return request_; }
  /// The request with which to continue; none if the match is yet to begin.
  [[nodiscard]] std::optional<v1::WatchMatchRequest> watching() const;
  /// The name of the match; empty before it is known.
  [[nodiscard]] const std::string& match_id() const { return match_id_; }
  /// The number of the last event that is known.
  [[nodiscard]] std::uint64_t after() const { return after_; }

  /// Whether the result has come: a connection that is lost later does not matter.
  [[nodiscard]] bool ends(const Failure& failure) const;

  /// Notes the next event, and returns whether to report it: the same may have come before.
  bool take(const v1::MatchResponse& event);

  /// Returns the time after which to ask again, or nothing if that is pointless. `watching` returns
  /// what to ask for then.
  std::optional<Seconds> pause_after(Failure failure, Attempts& attempts);

 private:
  /// Whether a match is as far as was reported; a match that is done again may not be for a while.
  /// Other progress than that of the search, such as of joining rooms, has no confidence.
  bool is_further(const v1::MatchProgress& progress);

  std::optional<v1::MatchRequest> request_;
  std::string match_id_;
  std::uint64_t after_ = 0;
  bool resumes_ = false;
  bool begun_ = false;
  std::array<bool, 5> told_{};  // by the kind of event
  bool again_ = false;
  double best_ = -std::numeric_limits<double>::infinity();
};

}  // namespace sketchmatch::detail
