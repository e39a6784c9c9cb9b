/* A candump log read with the C library alone: a line at a time, its parts by sscanf, its digits
 * one by one, as the usual players do. And the least that reading can cost: counting the lines. */
#ifndef BELTGRIP_TESTS_PAIRS_PLAIN_READER_H
#define BELTGRIP_TESTS_PAIRS_PLAIN_READER_H

#ifdef __cplusplus
extern "C" {
#endif

/* Frames or lines of the file; -1 where it cannot be read. */
long plain_read(const char* path);
long plain_count_lines(const char* path);

#ifdef __cplusplus
}
#endif
#endif
