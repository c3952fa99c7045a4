/// @file
/// Errors of calls, from the statuses of gRPC.
#pragma once

#include <grpcpp/support/status.h>

#include <optional>
#include <sketchmatch/errors.hpp>
#include <string>

namespace sketchmatch::detail {

/// An error before it is thrown.
struct Failure {
  /// One for each class of errors.
  enum class Kind {
    invalid_request,
    unavailable,
    busy,
    deadline_exceeded,
    not_authenticated,
    not_found,
    store,
    not_supported,
    cancelled,
    failed
  };

  Kind kind = Kind::failed;
  std::string message;
  std::string reason;
  std::string field;
  std::optional<Seconds> retry_after;
  /// What gRPC reports about a connection that failed.
  std::string detail;

  /// Throws it.
  [[noreturn]] void raise() const;
};

/// Returns the error for a status that is not OK, of a call to the server at an address.
Failure failure_of(const grpc::Status& status, const std::string& address);

}  // namespace sketchmatch::detail
