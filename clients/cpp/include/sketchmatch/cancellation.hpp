/// @file
/// Stopping calls from elsewhere.
#pragma once

#include <memory>

namespace sketchmatch {

namespace detail {
class CancellationState;
}

/// Stops the calls that it was given to. Copies stop the same calls, from any thread.
class Cancellation {
 public:
  Cancellation();

  /// Stops these calls, and those to which it is given later: threads that wait for one get a
  /// `CallCancelledError`.
  void cancel() const;

  /// Whether it was cancelled.
  [[nodiscard]] bool cancelled() const;

  /// The state that calls share with it.
  [[nodiscard]] const std::shared_ptr<detail::CancellationState>& state() const noexcept {
    return state_;
  }

 private:
  std::shared_ptr<detail::CancellationState> state_;
};

}  // namespace sketchmatch
