#include "tools/sim/reference_receiver.h"

enum { kLength = 8, kDataIdLow = 0xA2, kDataIdHigh = 0x06, kCounters = 15 };

static uint8_t crc_step(uint8_t crc, uint8_t byte) {
  crc = (uint8_t)(crc ^ byte);
  for (int bit = 0; bit < 8; ++bit) {
    const unsigned shifted = (unsigned)crc << 1;
    crc = (uint8_t)((crc & 0x80u) != 0 ? shifted ^ 0x1Du : shifted);
  }
  return crc;
}

static bool crc_right(const uint8_t* data) {
  uint8_t crc = crc_step(crc_step(0, kDataIdLow), kDataIdHigh);
  for (int i = 1; i < kLength; ++i) crc = crc_step(crc, data[i]);
  return crc == data[0];
}

static void end_request(struct beltgrip_receiver* receiver, uint32_t now_us) {
  receiver->active = false;
  receiver->may_start = false;
  receiver->pause = true;
  receiver->ended_us = now_us;
}

static void check_time(struct beltgrip_receiver* receiver, uint32_t now_us) {
  if (receiver->pause && now_us - receiver->ended_us >= BELTGRIP_PAUSE_US) receiver->pause = false;
  if (receiver->active && now_us - receiver->last_valid_us > BELTGRIP_TIMEOUT_US) {
    end_request(receiver, now_us);
  }
}

void beltgrip_receiver_init(struct beltgrip_receiver* receiver) {
  const struct beltgrip_receiver empty = {0};
  *receiver = empty;
}

bool beltgrip_receiver_frame(struct beltgrip_receiver* receiver, const uint8_t* data,
                             unsigned length, uint32_t now_us) {
  check_time(receiver, now_us);
  if (length != kLength || !crc_right(data)) return false;
  const uint8_t counter = data[1] & 0x0Fu;
  const bool asks = data[2] == 1u;
  const uint16_t force_N = (uint16_t)(data[3] | (unsigned)data[4] << 8);
  if (counter >= kCounters || (data[1] & 0xF0u) != 0 || data[2] > 1u || asks != (force_N > 0) ||
      data[5] != 0 || data[6] != 0 || data[7] != 0) {
    return false;
  }
  const unsigned delta =
      ((unsigned)counter + kCounters - (unsigned)receiver->last_counter) % kCounters;
  const bool in_sequence = receiver->synchronised && delta >= 1 && delta <= BELTGRIP_MAX_DELTA;
  receiver->synchronised = true;
  receiver->last_counter = counter;
  if (!asks) {
    if (receiver->active) end_request(receiver, now_us);
    receiver->may_start = true;
    return in_sequence;
  }
  const bool may_start = receiver->may_start && !receiver->pause;
  if (!in_sequence || !(receiver->active || may_start)) return false;
  receiver->active = true;
  receiver->last_valid_us = now_us;
  receiver->force_N = force_N;
  return true;
}

double beltgrip_receiver_force(struct beltgrip_receiver* receiver,
                               const struct beltgrip_limits* limits, double own_force_N,
                               bool permitted, uint32_t now_us) {
  check_time(receiver, now_us);
  if (receiver->active && !permitted) end_request(receiver, now_us);
  double force_N = own_force_N;
  if (receiver->active) {
    const double start_N = receiver->lowered ? receiver->applied_N : own_force_N;
    const double elapsed_s =
        receiver->lowered ? (double)(uint32_t)(now_us - receiver->applied_at_us) * 1e-6 : 0.0;
    const double lowest_N = start_N - limits->fall_rate_max_N_per_s * elapsed_s;
    if (force_N > receiver->force_N) force_N = receiver->force_N;
    if (force_N < lowest_N) force_N = lowest_N;
    if (force_N < limits->floor_N) force_N = limits->floor_N;
    if (force_N > own_force_N) force_N = own_force_N;
  }
  receiver->lowered = receiver->active;
  receiver->applied_N = force_N;
  receiver->applied_at_us = now_us;
  return force_N;
}

double beltgrip_own_torque_Nm(struct beltgrip_own_torque* torque, double requested_Nm,
                              double actual_Nm, uint32_t now_us) {
  const double requested = requested_Nm < 0.0 ? -requested_Nm : requested_Nm;
  const double actual = actual_Nm < 0.0 ? -actual_Nm : actual_Nm;
  const double now_Nm = requested > actual ? requested : actual;
  const bool differ = (requested_Nm < 0.0) != (actual_Nm < 0.0);
  if (!torque->reversing && !differ) return now_Nm;
  if (!torque->reversing || torque->held_Nm < now_Nm) torque->held_Nm = now_Nm;
  if (differ) {
    torque->reversing = true;
    torque->differed_us = now_us;
  } else if ((uint32_t)(now_us - torque->differed_us) >= BELTGRIP_REVERSAL_US) {
    torque->reversing = false;
    return now_Nm;
  }
  return torque->held_Nm;
}
