#include "tests/pairs/plain_decoder.h"

int plain_unpack(struct plain_signals* out, const uint8_t* p, size_t size) {
  if (size < 8U) return -1;
  out->speed = (uint16_t)(p[0] | (uint16_t)p[1] << 8);
  uint16_t torque = (uint16_t)(p[2] | (uint16_t)(p[3] & 0x0FU) << 8);
  if (torque & 0x800U) torque |= 0xF000U;
  out->torque = (int16_t)torque;
  out->gear = (uint8_t)(p[3] >> 4);
  out->pressure = (uint16_t)((uint16_t)p[4] << 8 | p[5]);
  uint16_t slope = (uint16_t)((uint16_t)p[6] << 2 | p[7] >> 6);
  if (slope & 0x200U) slope |= 0xFC00U;
  out->slope = (int16_t)slope;
  out->mode = (uint8_t)((p[7] >> 3) & 7U);
  out->flag = (uint8_t)((p[7] >> 2) & 1U);
  out->state = (uint8_t)(p[7] & 3U);
  return 0;
}

double plain_speed(uint16_t value) { return (double)value * 0.25; }
double plain_torque(int16_t value) { return (double)value * 0.1 + -40.0; }
double plain_gear(uint8_t value) { return (double)value; }
double plain_pressure(uint16_t value) { return (double)value * 0.01; }
double plain_slope(int16_t value) { return (double)value * 0.5; }
double plain_mode(uint8_t value) { return (double)value; }
double plain_flag(uint8_t value) { return (double)value; }
double plain_state(uint8_t value) { return (double)value; }

/* One case as the generator writes each of them. */
#define CASE(number)                                               \
  case number: {                                                   \
    struct plain_case* r = &out->of[number];                       \
    r->a = p[1];                                                   \
    r->b = (uint16_t)(p[2] | (uint16_t)p[3] << 8);                 \
    r->c = (uint16_t)(p[4] | (uint16_t)(p[5] & 0x0FU) << 8);       \
    r->d = (uint8_t)(p[5] >> 4);                                   \
    uint16_t e = (uint16_t)(p[6] | (uint16_t)(p[7] & 3U) << 8);    \
    if (e & 0x200U) e |= 0xFC00U;                                  \
    r->e = (int16_t)e;                                             \
    r->f = (uint8_t)(p[7] >> 2);                                   \
    break;                                                         \
  }

int plain_unpack_cases(struct plain_cases* out, const uint8_t* p, size_t size) {
  if (size < 8U) return -1;
  out->selector = p[0];
  switch (out->selector) {
    CASE(0) CASE(1) CASE(2) CASE(3) CASE(4) CASE(5) CASE(6) CASE(7)
    CASE(8) CASE(9) CASE(10) CASE(11) CASE(12) CASE(13) CASE(14) CASE(15)
    default: break;
  }
  return 0;
}

double plain_selector(uint8_t value) { return (double)value; }
double plain_a(uint8_t value) { return (double)value * 0.5; }
double plain_b(uint16_t value) { return (double)value * 0.01 + -100.0; }
double plain_c(uint16_t value) { return (double)value * 0.1; }
double plain_d(uint8_t value) { return (double)value; }
double plain_e(int16_t value) { return (double)value * 0.25; }
double plain_f(uint8_t value) { return (double)value; }
