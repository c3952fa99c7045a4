/// @file
/// Stopping calls from elsewhere.
#pragma once

#include <memory>

namespace sketchmatch {

namespace detail {
class CancellationState;
}

/// Stops the calls that it was given to. Copies stop the same ones; any thread may.
class Cancellation {
 public:
  Cancellation();

  /// Stops these calls, now and later: whoever waits for one gets a `CallCancelledError`.
  void cancel() const;

  /// Whether it was cancelled.
  [[nodiscard]] bool cancelled() const;

  /// What calls see of it.
  [[nodiscard]] const std::shared_ptr<detail::CancellationState>& state() const noexcept {
    return state_;
  }

 private:
  std::shared_ptr<detail::CancellationState> state_;
};

}  // namespace sketchmatch
