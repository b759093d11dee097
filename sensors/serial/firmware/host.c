/* The firmware as a program on a computer, for tests: standard input and output are the line, and the wheels are ideal.
 * Prints its speeds on standard error whenever they change. SONARS is 1: a wall 1 m ahead of the start. */
#define _POSIX_C_SOURCE 200809L
#include "robot.h"

#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

static double wheels[2];
static int32_t held[2];
static double moved_at;
static uint32_t pinged_at;

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

uint32_t board_ms(void) { return (uint32_t)(int64_t)(1e3 * seconds()); }

int board_read(void) {
    struct pollfd input = {.fd = 0, .events = POLLIN};
    unsigned char byte;
    if (poll(&input, 1, 0) <= 0) return -1;
    /* The line is gone: a robot runs on, this program ends. */
    if (read(0, &byte, 1) != 1) exit(0);
    return byte;
}

void board_write(const char *bytes, int count) {
    if (write(1, bytes, (size_t)count) < 0) exit(0);
}

void board_counts(int32_t counts[2]) {
    for (int i = 0; i < 2; i++) counts[i] = (int32_t)(int64_t)wheels[i];
}

void board_speeds(int32_t left, int32_t right) {
    double now = seconds();
    for (int i = 0; i < 2; i++) wheels[i] += held[i] * (now - moved_at);
    moved_at = now;
    if (held[0] != left || held[1] != right) {
        fprintf(stderr, "%ld %ld\n", (long)left, (long)right);
        fflush(stderr);
    }
    held[0] = left;
    held[1] = right;
}

int board_sense(uint16_t *bumpers, int16_t sonars[SONARS]) {
    uint32_t now = board_ms();
    *bumpers = 0;
    sonars[0] = SONAR_UNCHANGED;
    if (now - pinged_at >= 60) {
        /* 5000 counts are a meter. */
        double range = 1000.0 - 0.1 * (wheels[0] + wheels[1]);
        pinged_at = now;
        sonars[0] = range < 0 ? 0 : range > 3000 ? SONAR_SILENT : (int16_t)range;
    }
    return 0;
}

int main(void) {
    struct timespec pause = {.tv_nsec = 1000000};
    moved_at = seconds();
    robot_setup();
    for (;;) {
        robot_loop();
        nanosleep(&pause, NULL);
    }
}
