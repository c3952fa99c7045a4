/// @file
/// The errors of calls, each with one sentence for people and a reason for programs.
#pragma once

#include <chrono>
#include <optional>
#include <stdexcept>
#include <string>

namespace sketchmatch {

/// A time in seconds; durations of `std::chrono` convert to it by themselves.
using Seconds = std::chrono::duration<double>;

/// Base of every error of this package. `what()` is one sentence for people.
class SketchmatchError : public std::runtime_error {
 public:
  /// @param message One sentence for people.
  /// @param reason A name of `sketchmatch.v1.ErrorReason` without its prefix; empty if none was
  ///   given.
  /// @param detail What gRPC or another part reports; it is put in brackets behind the sentence.
  explicit SketchmatchError(const std::string& message, std::string reason = {},
                            const std::string& detail = {});

  /// A name of `sketchmatch.v1.ErrorReason` without its prefix, e.g. `"INVALID_STROKE"`.
  [[nodiscard]] const std::string& reason() const noexcept { return reason_; }

  /// What to do: the part of the sentence behind its semicolon, or empty if there is none.
  [[nodiscard]] const std::string& remedy() const noexcept { return remedy_; }

 private:
  std::string reason_;
  std::string remedy_;
};

/// The request is wrong; correct it. The same request would fail again.
class InvalidRequestError : public SketchmatchError {
 public:
  /// @param message One sentence with the remedy.
  /// @param reason What kind of fault it is.
  /// @param field Path of the field at fault; empty for the whole.
  explicit InvalidRequestError(const std::string& message, std::string reason = {},
                               std::string field = {});

  /// Path of the field at fault, e.g. `"sketch.stroke_set.strokes[3]"`; empty for the whole.
  [[nodiscard]] const std::string& field() const noexcept { return field_; }

 private:
  std::string field_;
};

/// The same request may succeed later.
class RetryableError : public SketchmatchError {
 public:
  /// @param message One sentence.
  /// @param reason Why it did not succeed now.
  /// @param retry_after Time after which to send the request again, if the server said so.
  /// @param detail What gRPC or another part reports.
  explicit RetryableError(const std::string& message, std::string reason = {},
                          std::optional<Seconds> retry_after = std::nullopt,
                          const std::string& detail = {});

  /// Time after which to send the same request again, if the server said so.
  [[nodiscard]] std::optional<Seconds> retry_after() const noexcept { return retry_after_; }

 private:
  std::optional<Seconds> retry_after_;
};

/// No server answers, or it is starting or stopping, or its process for the request has crashed.
class ServerUnavailableError : public RetryableError {
  using RetryableError::RetryableError;
};

/// The server is too busy for the request now; send it again after `retry_after()`.
class ServerBusyError : public RetryableError {
  using RetryableError::RetryableError;
};

/// The time limit passed before there was an answer; allow more time.
class DeadlineExceededError : public SketchmatchError {
  using SketchmatchError::SketchmatchError;
};

/// The server does not know the token, or the client does not trust the server's certificate. If
/// the server requires a certificate of the client, or another one, the error is a
/// `ServerUnavailableError`.
class NotAuthenticatedError : public SketchmatchError {
  using SketchmatchError::SketchmatchError;
};

/// The server has nothing of this name, or it belongs to another caller.
class NotFoundError : public SketchmatchError {
  using SketchmatchError::SketchmatchError;
};

/// The server cannot read or write its store on disk; its operator has to act.
class StoreError : public SketchmatchError {
  using SketchmatchError::SketchmatchError;
};

/// The server does not know the method; it is older than this client, or another kind of server.
class NotSupportedError : public SketchmatchError {
  using SketchmatchError::SketchmatchError;
};

/// The call was cancelled.
class CallCancelledError : public SketchmatchError {
  using SketchmatchError::SketchmatchError;
};

/// The server or an algorithm failed; the message says which.
class ServerFailedError : public SketchmatchError {
  using SketchmatchError::SketchmatchError;
};

}  // namespace sketchmatch
