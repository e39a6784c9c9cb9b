// The least that a program can do: wait for the next instant of a grid with ppoll, write one frame.
// What beltgripd's delay from sample to frame is held against. minimal_sender INTERFACE ID PERIOD_NS;
// says "start T", the first instant on the wall clock in ns, and ends with a signal.
#define _GNU_SOURCE
#include <linux/can.h>
#include <net/if.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

static int64_t clock_ns(clockid_t clock) {
  struct timespec time;
  clock_gettime(clock, &time);
  return (int64_t)time.tv_sec * 1000000000 + time.tv_nsec;
}

int main(int argc, char** argv) {
  if (argc != 4) return 64;
  struct sockaddr_can address = {.can_family = AF_CAN,
                                 .can_ifindex = (int)if_nametoindex(argv[1])};
  const struct can_frame frame = {.can_id = (canid_t)strtoul(argv[2], NULL, 0), .len = 8};
  const int64_t period_ns = strtoll(argv[3], NULL, 0);
  const int raw = socket(PF_CAN, SOCK_RAW, CAN_RAW);
  if (raw < 0 || bind(raw, (struct sockaddr*)&address, sizeof address) != 0) return 69;
  const int64_t wall_ns = clock_ns(CLOCK_REALTIME);
  const int64_t start_ns = clock_ns(CLOCK_MONOTONIC);
  printf("start %lld\n", (long long)wall_ns);
  fflush(stdout);
  for (int64_t deadline_ns = start_ns + period_ns;; deadline_ns += period_ns) {
    for (int64_t now_ns; (now_ns = clock_ns(CLOCK_MONOTONIC)) < deadline_ns;) {
      const int64_t left_ns = deadline_ns - now_ns;
      const struct timespec left = {left_ns / 1000000000, left_ns % 1000000000};
      ppoll(NULL, 0, &left, NULL);
    }
    if (write(raw, &frame, sizeof frame) != sizeof frame) return 74;
  }
}
