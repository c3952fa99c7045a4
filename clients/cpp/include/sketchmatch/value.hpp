/// @file
/// Values of parameters of algorithms.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

namespace sketchmatch {

/// A value of JSON: null, true or false, a number, a text, a list or an object.
///
/// Plain values are converted to it implicitly: `options.params["searcher"]["population"] = 200`.
class Value {
 public:
  /// Values in an order.
  using List = std::vector<Value>;
  /// Values by name.
  using Object = std::map<std::string, Value>;
  /// What a value can be.
  using Kind = std::variant<std::nullptr_t, bool, double, std::string, List, Object>;

  /// Null.
  Value() = default;
  /// Null.
  Value(std::nullptr_t /*null*/) {}  // NOLINT(google-explicit-constructor)
  /// A number, or true or false.
  template <typename Number, std::enable_if_t<std::is_arithmetic_v<Number>, int> = 0>
  Value(Number number) {  // NOLINT(google-explicit-constructor)
    if constexpr (std::is_same_v<Number, bool>) {
      kind_ = number;
    } else {
      kind_ = static_cast<double>(number);
    }
  }
  /// A text.
  Value(const char* text) : kind_(std::string(text)) {}  // NOLINT(google-explicit-constructor)
  /// A text.
  Value(std::string text) : kind_(std::move(text)) {}  // NOLINT(google-explicit-constructor)
  /// A list.
  Value(List list) : kind_(std::move(list)) {}  // NOLINT(google-explicit-constructor)
  /// An object.
  Value(Object object) : kind_(std::move(object)) {}  // NOLINT(google-explicit-constructor)

  /// What it is.
  [[nodiscard]] const Kind& kind() const noexcept { return kind_; }

  /// Whether two values are the same.
  friend bool operator==(const Value& a, const Value& b) { return a.kind_ == b.kind_; }
  /// Whether two values are not the same.
  friend bool operator!=(const Value& a, const Value& b) { return !(a == b); }

 private:
  Kind kind_;
};

/// Parameters of an algorithm, by name.
using Parameters = Value::Object;

}  // namespace sketchmatch
