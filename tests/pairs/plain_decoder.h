/* Two messages decoded as a C program does that a generator wrote from their DBC: one function
 * takes the raw numbers out of the payload, every shift and mask a constant, one switch for the
 * multiplexer; one more function a signal gives what its number stands for. Beside it the codec is
 * measured. */
#ifndef BELTGRIP_TESTS_PAIRS_PLAIN_DECODER_H
#define BELTGRIP_TESTS_PAIRS_PLAIN_DECODER_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

struct plain_signals {
  uint16_t speed;
  int16_t torque;
  uint8_t gear;
  uint16_t pressure;
  int16_t slope;
  uint8_t mode, flag, state;
};
/* 0, or -1 where the payload is too short. */
int plain_unpack(struct plain_signals* out, const uint8_t* payload, size_t size);
double plain_speed(uint16_t value);
double plain_torque(int16_t value);
double plain_gear(uint8_t value);
double plain_pressure(uint16_t value);
double plain_slope(int16_t value);
double plain_mode(uint8_t value);
double plain_flag(uint8_t value);
double plain_state(uint8_t value);

#define PLAIN_CASES 16
struct plain_case {
  uint8_t a;
  uint16_t b;
  uint16_t c;
  uint8_t d;
  int16_t e;
  uint8_t f;
};
struct plain_cases {
  uint8_t selector;
  struct plain_case of[PLAIN_CASES];
};
int plain_unpack_cases(struct plain_cases* out, const uint8_t* payload, size_t size);
double plain_selector(uint8_t value);
double plain_a(uint8_t value);
double plain_b(uint16_t value);
double plain_c(uint16_t value);
double plain_d(uint8_t value);
double plain_e(int16_t value);
double plain_f(uint8_t value);

#ifdef __cplusplus
}
#endif
#endif
