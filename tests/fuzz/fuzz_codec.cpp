// Any definition of a signal and any payload: the compiled codec equals the bits picked one by one;
// writing back what was read changes nothing; encoding what was decoded gives the same value.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "can_dbc/dbc/signal_codec.h"
#include "tests/can_dbc/dbc/naive_codec.h"

namespace {

using namespace beltgrip::can;

void require(bool condition, int line = __builtin_LINE()) {
  if (condition) return;
  std::fprintf(stderr, "fuzz_codec.cpp:%d\n", line);
  std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // Start bit (2 bytes), length, kind, scale and offset (8 bytes each), payload.
  constexpr std::size_t kHead = 20;
  if (size < kHead) return 0;
  SignalDef signal;
  signal.start_bit = data[0] | (std::uint32_t{data[1]} << 8);
  signal.length = data[2] % 70;
  signal.byte_order = (data[3] & 1) != 0 ? ByteOrder::kBig : ByteOrder::kLittle;
  signal.type = static_cast<ValueType>((data[3] >> 1) & 3);
  std::memcpy(&signal.scale, data + 4, 8);
  std::memcpy(&signal.offset, data + 12, 8);
  std::vector<std::uint8_t> payload(data + kHead, data + size);
  if (payload.size() > 64) payload.resize(64);

  const SignalCodec codec(signal);
  require(codec.fits(payload.size()) == beltgrip::testing::naive_fits(signal, payload.size()));
  if (!codec.fits(payload.size())) return 0;
  const std::uint64_t raw = codec.raw(payload);
  SignalDef as_bits = signal;
  const bool no_float = !codec.is_float();
  if (signal.type >= ValueType::kFloat32) as_bits.type = ValueType::kUnsigned;
  require(raw == beltgrip::testing::naive_raw(as_bits, payload));

  std::vector<std::uint8_t> written = payload;
  codec.insert(written, raw);
  require(written == payload);
  for (auto& byte : written) byte = static_cast<std::uint8_t>(~byte);
  codec.insert(written, raw);
  require(codec.raw(written) == raw);

  const double value = codec.physical(raw);
  const std::uint64_t back = codec.raw_from_physical(value);
  written = payload;
  codec.insert(written, back);
  require(codec.raw(written) == back);  // inside the signal's bits
  const double scale = std::fabs(signal.scale);
  const bool well_conditioned = no_float && scale >= 1e-6 && scale <= 1e6 &&
                                std::fabs(signal.offset) <= 1e6 && signal.length <= 32;
  if (well_conditioned) require(back == raw);
  require(!codec.raw_text(raw).empty());
  return 0;
}
