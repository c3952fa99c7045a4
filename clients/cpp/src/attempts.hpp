/// @file
/// When a request is sent again. Any may be, since requests have no side effects.
#pragma once

#include <grpcpp/client_context.h>

#include <chrono>
#include <optional>
#include <sketchmatch/errors.hpp>

#include "statuses.hpp"

namespace sketchmatch::detail {

/// Returns how long a call may take, or nothing for no limit.
/// @throws InvalidRequestError If it is negative or not a number.
std::optional<Seconds> limit_of(Seconds timeout);

/// The attempts of one call, which share its time limit.
class Attempts {
 public:
  /// @param retries How often the request may be sent again.
  /// @param limit Time for all attempts together, or nothing for no limit.
  Attempts(int retries, std::optional<Seconds> limit);

  /// Sets the deadline of the next attempt.
  void limit(grpc::ClientContext& context) const;

  /// Returns the time after which to send the request again, or nothing if that is pointless. It is
  /// at least what the server asks for, grows from one attempt to the next, and varies randomly, so
  /// that callers do not all return at once.
  /// @param begun Whether the answer had begun: then attempts go on for a minute, whatever their
  ///   number, unless there are to be none.
  std::optional<Seconds> pause_after(const Failure& failure, bool begun = false);

  /// Notes that the server answers.
  void succeeded();

 private:
  int retries_;
  std::optional<std::chrono::steady_clock::time_point> deadline_;
  Seconds backoff_;
  std::optional<std::chrono::steady_clock::time_point> gives_up_;
};

}  // namespace sketchmatch::detail
