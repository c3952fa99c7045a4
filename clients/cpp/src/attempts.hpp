/// @file
/// When the same request is sent again: it changes nothing, so that any may be.
#pragma once

#include <grpcpp/client_context.h>

#include <chrono>
#include <optional>
#include <sketchmatch/errors.hpp>

#include "statuses.hpp"

namespace sketchmatch::detail {

/// Returns how long a call may take; none for no limit.
/// @throws InvalidRequestError If it is negative or no number.
std::optional<Seconds> limit_of(Seconds timeout);

/// The attempts of one call, which share its time.
class Attempts {
 public:
  /// @param retries How often the request may be sent again.
  /// @param limit For all attempts together, or none.
  Attempts(int retries, std::optional<Seconds> limit);

  /// Says until when the next attempt may take.
  void limit(grpc::ClientContext& context) const;

  /// Returns after which time to send the request again; none if it is in vain. It is no less than
  /// the server asks for, grows from one attempt to the next, and differs from caller to caller, so
  /// that not all come back at once.
  /// @param begun Whether the answer had begun: that is worth a minute's attempts, whatever their
  ///   number, unless there are to be none.
  std::optional<Seconds> pause_after(const Failure& failure, bool begun = false);

  /// Hears that the server answers.
  void succeeded();

 private:
  int retries_;
  std::optional<std::chrono::steady_clock::time_point> deadline_;
  Seconds backoff_;
  std::optional<std::chrono::steady_clock::time_point> gives_up_;
};

}  // namespace sketchmatch::detail
