#include <google/protobuf/any.pb.h>
#include <sketchmatch_rpc/error_details.pb.h>
#include <sketchmatch_rpc/status.pb.h>

#include <array>
#include <regex>
#include <sketchmatch/errors.hpp>
#include <utility>

#include "statuses.hpp"
#include "text.hpp"

namespace sketchmatch {

namespace {

std::string behind_the_semicolon(const std::string& sentence) {
  const auto end = sentence.rfind("; ");
  return end == std::string::npos ? std::string() : sentence.substr(end + 2);
}

}  // namespace

SketchmatchError::SketchmatchError(const std::string& message, std::string reason,
                                   const std::string& detail)
    : std::runtime_error(detail.empty() ? message : message + " (" + detail + ")"),
      reason_(std::move(reason)),
      remedy_(behind_the_semicolon(message)) {}

InvalidRequestError::InvalidRequestError(const std::string& message, std::string reason,
                                         std::string field)
    : SketchmatchError(message, std::move(reason)), field_(std::move(field)) {}

RetryableError::RetryableError(const std::string& message, std::string reason,
                               std::optional<Seconds> retry_after, const std::string& detail)
    : SketchmatchError(message, std::move(reason), detail), retry_after_(retry_after) {}

namespace detail {

namespace {

/// The details that this package knows.
struct Details {
  std::string reason;
  std::string field;
  std::optional<Seconds> retry_after;
};

/// Reads a detail if it is of a kind; ours has the same fields as Google's, under another name.
template <typename Detail>
bool unpacked(const google::protobuf::Any& packed, const char* name, Detail& detail) {
  return packed.type_url() == std::string("type.googleapis.com/google.rpc.") + name &&
         detail.ParseFromString(packed.value());
}

Details details_of(const grpc::Status& status) {
  Details found;
  rpc::Status packed;
  if (!packed.ParseFromString(status.error_details())) {
    return found;
  }
  for (const auto& each : packed.details()) {
    rpc::ErrorInfo info;
    rpc::BadRequest bad;
    rpc::RetryInfo retry;
    if (unpacked(each, "ErrorInfo", info)) {
      found.reason = info.reason();
    } else if (unpacked(each, "BadRequest", bad) && bad.field_violations_size() > 0) {
      found.field = bad.field_violations(0).field();
    } else if (unpacked(each, "RetryInfo", retry) && retry.has_retry_delay()) {
      const auto& delay = retry.retry_delay();
      found.retry_after =
          std::chrono::seconds(delay.seconds()) + Seconds(std::chrono::nanoseconds(delay.nanos()));
    }
  }
  return found;
}

const char* name_of(grpc::StatusCode code) {
  constexpr std::array kNames{"OK",
                              "CANCELLED",
                              "UNKNOWN",
                              "INVALID_ARGUMENT",
                              "DEADLINE_EXCEEDED",
                              "NOT_FOUND",
                              "ALREADY_EXISTS",
                              "PERMISSION_DENIED",
                              "RESOURCE_EXHAUSTED",
                              "FAILED_PRECONDITION",
                              "ABORTED",
                              "OUT_OF_RANGE",
                              "UNIMPLEMENTED",
                              "INTERNAL",
                              "UNAVAILABLE",
                              "DATA_LOSS",
                              "UNAUTHENTICATED"};
  const auto number = static_cast<std::size_t>(code);
  return number < kNames.size() ? kNames.at(number) : "an unknown status";
}

bool contains(const std::string& text, const char* part) {
  return text.find(part) != std::string::npos;
}

/// Why a certificate cannot be trusted, by what gRPC says; nothing if it does not say that.
std::optional<std::string> distrust(const std::string& message) {
  static const std::regex other_name("Hostname Verification Check|Peer name .* is not in peer");
  // As BoringSSL says it, and as OpenSSL does.
  static const std::regex refused(
      "(?:CERTIFICATE_VERIFY_FAILED|certificate verify failed):? ?([^:]*)");
  std::smatch found;
  if (std::regex_search(message, other_name)) {
    return "it is for another name";
  }
  if (!std::regex_search(message, found, refused)) {
    return std::nullopt;
  }
  const std::string why = stripped(found[1].str());
  // OpenSSL does not say why.
  return why.empty() ? "it is of no authority that the client trusts, or it has expired" : why;
}

/// Returns the error for a connection that failed, for which gRPC has no status of its own.
Failure unavailable(const std::string& message, const std::string& address) {
  if (const auto why = distrust(message)) {
    return {Failure::Kind::not_authenticated,
            "the certificate of the server at " + address + " cannot be trusted (" + *why +
                "); give the root_certificates of its authority and a server_name that it is for, "
                "or renew it",
            {},
            {},
            {},
            {}};
  }
  // gRPC notices this when it connects; older and newer versions use different words.
  if (contains(message, "empty address list") || contains(message, "create security handshaker")) {
    return {Failure::Kind::invalid_request,
            "the certificates for the server at " + address +
                " cannot be used; give certificate and the key that belongs to it, without a "
                "passphrase, and root_certificates, all in PEM",
            "INVALID_FIELD",
            {},
            {},
            {}};
  }
  std::string remedy = "start it, or check the address";
  if (contains(message, "WRONG_VERSION_NUMBER") || contains(message, "wrong version number")) {
    remedy = "it does not use encryption: leave out certificates and tls";
  } else if (contains(message, "Socket closed")) {
    remedy =
        "it closed the connection: it is stopping, or requires encryption or a certificate of the "
        "client that it trusts; start it, or give root_certificates, certificate and key";
  } else if (contains(message, "http1.x server")) {
    remedy = "it speaks HTTP/1.1, as the port for browsers does; give the address for gRPC";
  }
  return {Failure::Kind::unavailable,
          "the sketchmatch server at " + address + " is not available; " + remedy,
          {},
          {},
          {},
          message};
}

Failure exhausted(Failure failure, const std::string& address) {
  if (failure.reason.empty() && contains(failure.message, "larger than max")) {
    return {Failure::Kind::invalid_request,
            "the request is larger than the server at " + address + " accepts; make it smaller",
            "MESSAGE_TOO_LARGE",
            {},
            {},
            {}};
  }
  failure.kind = Failure::Kind::busy;
  return failure;
}

Failure late(Failure failure, const std::string& address) {
  failure.kind = Failure::Kind::deadline_exceeded;
  if (failure.reason.empty()) {
    failure.message =
        "the server at " + address + " did not answer within the timeout; allow more time";
  }
  return failure;
}

}  // namespace

Failure failure_of(const grpc::Status& status, const std::string& address) {
  Details details = details_of(status);
  Failure failure;
  failure.message = status.error_message();
  if (failure.message.empty()) {
    failure.message = "the server at " + address + " reports " + name_of(status.error_code());
  }
  failure.reason = std::move(details.reason);
  failure.field = std::move(details.field);
  failure.retry_after = details.retry_after;
  switch (status.error_code()) {
    case grpc::StatusCode::INVALID_ARGUMENT:
      failure.kind = Failure::Kind::invalid_request;
      return failure;
    case grpc::StatusCode::RESOURCE_EXHAUSTED:
      return exhausted(std::move(failure), address);
    case grpc::StatusCode::UNAVAILABLE:
      failure.kind = Failure::Kind::unavailable;
      return failure.reason.empty() ? unavailable(failure.message, address) : failure;
    case grpc::StatusCode::DEADLINE_EXCEEDED:
      return late(std::move(failure), address);
    case grpc::StatusCode::CANCELLED:
      failure.kind = Failure::Kind::cancelled;
      return failure;
    case grpc::StatusCode::NOT_FOUND:
      failure.kind = Failure::Kind::not_found;
      return failure;
    case grpc::StatusCode::FAILED_PRECONDITION:
      failure.kind = Failure::Kind::store;
      return failure;
    case grpc::StatusCode::UNIMPLEMENTED:
      failure.kind = Failure::Kind::not_supported;
      return failure;
    case grpc::StatusCode::UNAUTHENTICATED:
    case grpc::StatusCode::PERMISSION_DENIED:
      failure.kind = Failure::Kind::not_authenticated;
      return failure;
    default:
      return failure;
  }
}

void Failure::raise() const {
  switch (kind) {
    case Kind::invalid_request:
      throw InvalidRequestError(message, reason, field);
    case Kind::unavailable:
      throw ServerUnavailableError(message, reason, retry_after, detail);
    case Kind::busy:
      throw ServerBusyError(message, reason, retry_after);
    case Kind::deadline_exceeded:
      throw DeadlineExceededError(message, reason);
    case Kind::not_authenticated:
      throw NotAuthenticatedError(message, reason);
    case Kind::not_found:
      throw NotFoundError(message, reason);
    case Kind::store:
      throw StoreError(message, reason);
    case Kind::not_supported:
      throw NotSupportedError(message, reason);
    case Kind::cancelled:
      throw CallCancelledError(message, reason);
    case Kind::failed:
      break;
  }
  throw ServerFailedError(message, reason);
}

}  // namespace detail
}  // namespace sketchmatch
