/// @file
/// The state that calls share with a cancellation.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <sketchmatch/cancellation.hpp>
#include <sketchmatch/errors.hpp>

namespace sketchmatch::detail {

/// Whether something was cancelled, and what is done then.
class CancellationState {
 public:
  void cancel();
  bool cancelled() const;

  /// Waits so long, or until it is cancelled.
  void wait_for(Seconds pause);

 private:
  friend class OnCancel;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  bool cancelled_ = false;
  std::uint64_t count_ = 0;
  std::map<std::uint64_t, std::function<void()>> actions_;
};

/// Calls a function when a state is cancelled, at once if it already is; not after destruction.
class OnCancel {
 public:
  OnCancel(std::shared_ptr<CancellationState> state, std::function<void()> action);
  OnCancel(const OnCancel&) = delete;
  OnCancel& operator=(const OnCancel&) = delete;
  OnCancel(OnCancel&&) = delete;
  OnCancel& operator=(OnCancel&&) = delete;
  ~OnCancel();

 private:
  std::shared_ptr<CancellationState> state_;
  std::uint64_t number_ = 0;
};

}  // namespace sketchmatch::detail
