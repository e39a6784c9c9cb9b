/* Reference receiver of BeltGripClamp for a transmission controller: what must be checked before a
 * clamping force is lowered on request. Plain C, no allocation, no clock, no dependency; the caller
 * gives the time in microseconds (it may wrap). One task; not for concurrent calls.
 *
 * A frame is valid if it has 8 bytes, the right CRC (AUTOSAR E2E profile 1, variant 1A, data id
 * 0x6A2), zero reserved bits, RequestActive = 1 exactly where SecondaryForce > 0, and a counter 1
 * to BELTGRIP_MAX_DELTA steps after the last correct one. A wrong sequence is not valid, but the
 * next frame is judged from it: a sender that starts anew is heard with its second frame.
 *
 * - An inactive frame with a right CRC ends a request at once, whatever its counter: letting go
 *   needs no proof.
 * - No valid active frame for BELTGRIP_TIMEOUT_US: the request is over.
 * - A request that is over stays over until an inactive frame has been seen, and for
 *   BELTGRIP_PAUSE_US: an old or stuck active frame cannot start one, nor can a second sender take
 *   the place of one that has just fallen silent.
 * - The controller decides: without its permission, and below its own floor, nothing is obeyed.
 */
#ifndef BELTGRIP_REFERENCE_RECEIVER_H
#define BELTGRIP_REFERENCE_RECEIVER_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define BELTGRIP_TIMEOUT_US 50000u
#define BELTGRIP_PAUSE_US 1000000u
#define BELTGRIP_MAX_DELTA 3u /* two frames in a row may be lost */

struct beltgrip_receiver {
  bool synchronised;      /* last_counter is known */
  uint8_t last_counter;   /* of the last frame with a right CRC */
  bool may_start;         /* an inactive frame came since the last request */
  bool pause;             /* a request ended less than BELTGRIP_PAUSE_US ago */
  uint32_t ended_us;      /* when */
  bool active;            /* a request stands */
  uint32_t last_valid_us; /* instant of the last valid active frame */
  uint16_t force_N;       /* what it asks */
  bool lowered;           /* applied_N is below the controller's own force */
  double applied_N;       /* force of the last call of beltgrip_receiver_force */
  uint32_t applied_at_us; /* and its instant */
};

struct beltgrip_limits {
  double floor_N;               /* never below, whatever is asked */
  double fall_rate_max_N_per_s; /* never faster, whatever is asked */
};

void beltgrip_receiver_init(struct beltgrip_receiver* receiver);

/* Every data frame with the identifier of BeltGripClamp, as received. True if it was valid. */
bool beltgrip_receiver_frame(struct beltgrip_receiver* receiver, const uint8_t* data,
                             unsigned length, uint32_t now_us);

/* The force to apply now, at least once every 10 ms: own_force_N unless a request stands and
 * permitted. A withdrawn permission ends the request. Never above own_force_N. */
double beltgrip_receiver_force(struct beltgrip_receiver* receiver,
                               const struct beltgrip_limits* limits, double own_force_N,
                               bool permitted, uint32_t now_us);

/* The torque that the controller's own clamping law has to hold, as a magnitude. The actual torque
 * follows the requested one late, and the hydraulics follow late again; through a reversal the
 * magnitude of either passes zero while the belt is about to be loaded the other way. So: the
 * larger of the two, and from the moment their signs differ until BELTGRIP_REVERSAL_US after they
 * agree again, the largest of all that was seen since. */
#define BELTGRIP_REVERSAL_US 300000u

struct beltgrip_own_torque {
  bool reversing;
  double held_Nm;
  uint32_t differed_us; /* when the signs last differed */
};

/* Once every control cycle; signed torques, positive in drive. Begins zeroed. */
double beltgrip_own_torque_Nm(struct beltgrip_own_torque* torque, double requested_Nm,
                              double actual_Nm, uint32_t now_us);

#ifdef __cplusplus
}
#endif

#endif
