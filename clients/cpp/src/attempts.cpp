#include "attempts.hpp"

#include <grpc/support/time.h>

#include <algorithm>
#include <random>

#include "text.hpp"

namespace sketchmatch::detail {

namespace {

constexpr Seconds kShortestPause{0.1};
constexpr Seconds kLongestPause{5.0};
constexpr Seconds kLongestPauseBegun{1.0};
// Time in which a server that had begun to answer should be back.
constexpr std::chrono::seconds kAway{60};
// gRPC fails at once if the deadline is beyond the range of its clock.
constexpr Seconds kForEver{1e8};

double between(double low, double high) {
  thread_local std::minstd_rand random{std::random_device{}()};
  return std::uniform_real_distribution<double>(low, high)(random);
}

}  // namespace

std::optional<Seconds> limit_of(Seconds timeout) {
  if (!(timeout.count() >= 0.0)) {  // nan is not
    refuse("timeout",
           "is " + shown(timeout.count()) + "; give seconds, at least 0, or infinity for no limit");
  }
  return timeout < kForEver ? std::optional(timeout) : std::nullopt;
}

Attempts::Attempts(int retries, std::optional<Seconds> limit)
    : retries_(retries), backoff_(kShortestPause) {
  if (limit) {
    deadline_ = std::chrono::steady_clock::now() +
                std::chrono::duration_cast<std::chrono::steady_clock::duration>(*limit);
  }
}

void Attempts::limit(grpc::ClientContext& context) const {
  if (deadline_) {
    const std::chrono::nanoseconds left = *deadline_ - std::chrono::steady_clock::now();
    context.set_deadline(
        gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC),
                     gpr_time_from_nanos(std::max<std::int64_t>(left.count(), 0), GPR_TIMESPAN)));
  }
}

std::optional<Seconds> Attempts::pause_after(const Failure& failure, bool begun) {
  const bool busy = failure.kind == Failure::Kind::busy && failure.retry_after.has_value();
  if (retries_ < 1 || (!busy && failure.kind != Failure::Kind::unavailable)) {
    return std::nullopt;
  }
  const Seconds asked = busy ? *failure.retry_after : Seconds(0.0);
  const Seconds pause = std::max(asked, backoff_) * between(1.0, 1.5);
  const auto now = std::chrono::steady_clock::now();
  if (begun && !gives_up_) {
    gives_up_ = now + kAway;
  }
  for (const auto& end : {deadline_, gives_up_}) {
    if (end && Seconds(*end - now) <= pause) {
      return std::nullopt;
    }
  }
  if (!begun) {
    --retries_;
  }
  backoff_ = std::min(2.0 * backoff_, begun ? kLongestPauseBegun : kLongestPause);
  return pause;
}

void Attempts::succeeded() {
  backoff_ = kShortestPause;
  gives_up_.reset();
}

}  // namespace sketchmatch::detail
