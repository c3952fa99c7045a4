#include <sketchmatch/cancellation.hpp>
#include <utility>

#include "cancellation_state.hpp"

namespace sketchmatch {

Cancellation::Cancellation() : state_(std::make_shared<detail::CancellationState>()) {}

// NOLINTNEXTLINE(readability-make-member-function-const): it is const, as copies share what changes
void Cancellation::cancel() const { state_->cancel(); }

bool Cancellation::cancelled() const { return state_->cancelled(); }

namespace detail {

void CancellationState::cancel() {
  const std::lock_guard lock(mutex_);
  cancelled_ = true;
  // Under the lock: what an action stops may not go away meanwhile.
  for (const auto& [number, action] : actions_) {
    action();
  }
  changed_.notify_all();
}

bool CancellationState::cancelled() const {
  const std::lock_guard lock(mutex_);
  return cancelled_;
}

void CancellationState::wait_for(Seconds pause) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, pause, [this] { return cancelled_; });
}

OnCancel::OnCancel(std::shared_ptr<CancellationState> state, std::function<void()> action)
    : state_(std::move(state)) {
  const std::lock_guard lock(state_->mutex_);
  if (state_->cancelled_) {
    action();
  }
  number_ = state_->count_++;
  state_->actions_.emplace(number_, std::move(action));
}

OnCancel::~OnCancel() {
  const std::lock_guard lock(state_->mutex_);
  state_->actions_.erase(number_);
}

}  // namespace detail
}  // namespace sketchmatch
