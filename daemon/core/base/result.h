// A value, or why there is none.
#pragma once

#include <string>
#include <utility>
#include <variant>

namespace beltgrip::daemon {

template <typename Value, typename Error = std::string>
class [[nodiscard]] Result {
 public:
  Result(Value value) : either_(std::in_place_index<0>, std::move(value)) {}
  Result(Error error) : either_(std::in_place_index<1>, std::move(error)) {}

  explicit operator bool() const { return either_.index() == 0; }
  Value& operator*() & { return std::get<0>(either_); }
  const Value& operator*() const& { return std::get<0>(either_); }
  Value&& operator*() && { return std::get<0>(std::move(either_)); }
  Value* operator->() { return &**this; }
  const Value* operator->() const { return &**this; }
  const Error& error() const { return std::get<1>(either_); }

 private:
  std::variant<Value, Error> either_;
};

}  // namespace beltgrip::daemon
