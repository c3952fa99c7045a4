#include "course.hpp"

#include <random>
#include <utility>

#include "text.hpp"

namespace sketchmatch::detail {

namespace {

/// Returns a name that no other request has.
std::string new_name() {
  constexpr int kBytes = 16;
  constexpr const char* kHex = "0123456789abcdef";
  std::random_device random;
  std::string name;
  for (int k = 0; k < 2 * kBytes; ++k) {
    name += kHex[random() % 16U];  // NOLINT: it has sixteen
  }
  return name;
}

/// Whether a match may have ended before its time: the same request does it again.
bool ended_early(const Failure& failure) {
  return failure.reason == "MATCH_INTERRUPTED" || failure.reason == "SERVER_STOPPING" ||
         failure.reason == "WORKER_LOST";
}

}  // namespace

Course::Course(v1::MatchRequest request) : request_(std::move(request)) {
  if (request_->request_id().empty()) {
    request_->set_request_id(new_name());
  }
}

Course::Course(const std::string& match_id, std::uint64_t after)
    : match_id_(checked_text(match_id, "match_id")), after_(after), resumes_(true) {}

std::optional<v1::WatchMatchRequest> Course::watching() const {
  if (!resumes_) {
    return std::nullopt;
  }
  v1::WatchMatchRequest request;
  request.set_match_id(match_id_);
  request.set_after(after_);
  return request;
}

bool Course::ends(const Failure& failure) const {
  return told_.at(v1::MatchResponse::kResult) && failure.kind == Failure::Kind::unavailable;
}

bool Course::take(const v1::MatchResponse& event) {
  const auto kind = event.event_case();
  if (kind == v1::MatchResponse::kAccepted) {
    match_id_ = event.accepted().match_id();
  }
  after_ = event.number();
  begun_ = true;
  const bool told = std::exchange(told_.at(kind), true);
  if (told && (kind == v1::MatchResponse::kAccepted || kind == v1::MatchResponse::kScenes)) {
    again_ = true;
    return false;
  }
  return kind != v1::MatchResponse::kProgress || is_further(event.progress());
}

bool Course::is_further(const v1::MatchProgress& progress) {
  if (!progress.has_confidence()) {
    return !again_ || best_ == -std::numeric_limits<double>::infinity();
  }
  if (progress.confidence() < best_) {
    return false;
  }
  best_ = progress.confidence();
  again_ = false;
  return true;
}

std::optional<Seconds> Course::pause_after(Failure failure, Attempts& attempts) {
  if (!begun_) {
    return attempts.pause_after(failure);
  }
  if (after_ == 0) {  // a server that cannot go on
    return std::nullopt;
  }
  if (!request_) {
    return ended_early(failure) ? std::nullopt : attempts.pause_after(failure, true);
  }
  if (failure.kind == Failure::Kind::not_found) {
    failure.kind = Failure::Kind::unavailable;
    failure.reason = "MATCH_INTERRUPTED";
  }
  if (failure.kind == Failure::Kind::unavailable) {
    resumes_ = !ended_early(failure);
  }
  return attempts.pause_after(failure, true);
}

}  // namespace sketchmatch::detail
