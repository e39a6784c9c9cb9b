// A message decoded as libraries do that keep a function a signal (dbcppp's way): chosen as the
// file is loaded, by byte order and sign; the multiplexer is decoded anew for each signal that it
// may select. Beside it the codec is measured.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "can_dbc/dbc/model.h"

namespace beltgrip::test {

class SignalBySignal {
 public:
  using Payload = std::array<std::uint8_t, 8>;

  // Integers inside eight bytes, one multiplexer at most.
  explicit SignalBySignal(const can::MessageDef& definition);
  // By the definition's order; what is not selected stays.
  void decode(const Payload& payload, std::vector<double>& values) const;

 private:
  struct Signal {
    std::uint64_t (*raw)(const Signal& signal, const Payload& payload);
    std::uint64_t mask, sign;
    unsigned shift;
    double scale, offset;
    bool is_selected;     // by the multiplexer
    std::uint64_t value;  // of it, then
  };
  static std::uint64_t little(const Signal& signal, const Payload& payload);
  static std::uint64_t big(const Signal& signal, const Payload& payload);
  static std::uint64_t little_signed(const Signal& signal, const Payload& payload);
  static std::uint64_t big_signed(const Signal& signal, const Payload& payload);

  std::vector<Signal> signals_;
  std::size_t multiplexer_ = 0;
};

}  // namespace beltgrip::test
