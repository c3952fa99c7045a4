/// @file
/// The course of a match as its reader sees it: one stream, however often the link is lost.
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

/// What is known of a match that is read, and so, how to go on after a link was lost.
class Course {
 public:
  /// A match to begin; the request is given a name if it has none.
  explicit Course(v1::MatchRequest request);
  /// A match that was begun before, after an event that is known of it.
  Course(const std::string& match_id, std::uint64_t after);

  /// What began the match, or will; none where it is only watched.
  [[nodiscard]] const std::optional<v1::MatchRequest>& request() const { return request_; }
  /// What to ask for to go on; none to begin, by the request.
  [[nodiscard]] std::optional<v1::WatchMatchRequest> watching() const;
  /// The name of the match; empty before it is known.
  [[nodiscard]] const std::string& match_id() const { return match_id_; }
  /// The number of the last event that is known.
  [[nodiscard]] std::uint64_t after() const { return after_; }

  /// Whether all is told: a link that is lost after the result is none of the match.
  [[nodiscard]] bool ends(const Failure& failure) const;

  /// Hears the next event, and returns whether to tell it: its like may have been told before.
  bool take(const v1::MatchResponse& event);

  /// Returns the time after which to ask again; none if it is in vain. What to ask for then is what
  /// `watching` says.
  std::optional<Seconds> pause_after(Failure failure, Attempts& attempts);

 private:
  /// Whether a match is as far as was told; one that is done again may not be for a while. Other
  /// progress than that of the search, as that of rooms that are joined, has no confidence.
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
