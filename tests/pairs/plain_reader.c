#include "tests/pairs/plain_reader.h"

#include <stdint.h>
#include <stdio.h>
#include <string.h>

static int digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

struct frame {
  uint64_t t_us;
  uint32_t id;
  uint8_t length;
  uint8_t data[64];
};

static int read_frame(const char* text, struct frame* frame) {
  frame->id = 0;
  frame->length = 0;
  for (; *text != '#'; ++text) {
    const int value = digit(*text);
    if (value < 0) return 0;
    frame->id = frame->id << 4 | (uint32_t)value;
  }
  for (++text; *text != '\0' && frame->length < 64; text += 2) {
    const int high = digit(text[0]);
    const int low = high < 0 ? -1 : digit(text[1]);
    if (low < 0) return 0;
    frame->data[frame->length++] = (uint8_t)(high << 4 | low);
  }
  return 1;
}

long plain_read(const char* path) {
  FILE* file = fopen(path, "r");
  if (file == NULL) return -1;
  char line[400], interface[64], text[256];
  unsigned long long seconds, microseconds;
  struct frame frame;
  long frames = 0;
  while (fgets(line, sizeof line, file) != NULL) {
    if (sscanf(line, "(%llu.%llu) %63s %255s", &seconds, &microseconds, interface, text) != 4) {
      continue;
    }
    frame.t_us = seconds * 1000000ULL + microseconds;
    frames += read_frame(text, &frame);
  }
  fclose(file);
  return frames;
}

long plain_count_lines(const char* path) {
  FILE* file = fopen(path, "r");
  if (file == NULL) return -1;
  static char block[262144];
  setvbuf(file, NULL, _IONBF, 0);
  long lines = 0;
  size_t count;
  while ((count = fread(block, 1, sizeof block, file)) > 0) {
    const char* const end = block + count;
    for (const char* at = block; (at = memchr(at, '\n', (size_t)(end - at))) != NULL; ++at) ++lines;
  }
  fclose(file);
  return lines;
}
