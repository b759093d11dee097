/* Line protocol of Yamabico: reference firmware. Needs 200 bytes of memory and no heap. */
#include "robot.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAX_LINE 128
#define STOPPED_BY_WATCHDOG 1
#define MOTORS_OFF 2

static char line[MAX_LINE]; /* received so far, without the '$' */
static int length = -1;     /* -1: waiting for a '$' */
static int32_t speeds[2];
static uint16_t taken;    /* number of the last drive line */
static int has_taken;     /* nonzero after the first one */
static uint32_t taken_at; /* ms */
static uint32_t sent_at;  /* ms */
static uint16_t sequence;
static int is_stopped = 1;

/* CRC-16, polynomial 0x1021, from 0xffff (CCITT-FALSE). */
static uint16_t checksum(const char *bytes, int count) {
    uint16_t crc = 0xffff;
    for (int i = 0; i < count; i++) {
        crc ^= (uint16_t)((uint8_t)bytes[i]) << 8;
        for (int bit = 0; bit < 8; bit++) crc = crc & 0x8000 ? (uint16_t)(crc << 1) ^ 0x1021 : (uint16_t)(crc << 1);
    }
    return crc;
}

/* Sends "$fields*checksum\n". */
static void send_fields(const char *fields, int count) {
    char tail[8];
    int tail_count = snprintf(tail, sizeof tail, "*%04X\n", (unsigned)checksum(fields, count));
    board_write("$", 1);
    board_write(fields, count);
    board_write(tail, tail_count);
}

static void send_identity(void) {
    char fields[64];
    int count = snprintf(fields, sizeof fields, "I,1,%s,%d", ROBOT_NAME, WATCHDOG_MS);
    send_fields(fields, count);
}

static void send_measurement(uint32_t now) {
    char fields[MAX_LINE];
    uint16_t bumpers = 0;
    int16_t sonars[SONARS];
    int32_t counts[2];
    int is_off = board_sense(&bumpers, sonars);
    board_counts(counts);
    int state = (is_stopped ? STOPPED_BY_WATCHDOG : 0) | (is_off ? MOTORS_OFF : 0);
    int count = snprintf(fields, sizeof fields, "M,%u,%lu,%ld,%ld,%u,%u,%d", (unsigned)sequence++, (unsigned long)now,
                         (long)counts[0], (long)counts[1], (unsigned)bumpers, (unsigned)taken, state);
    for (int i = 0; i < SONARS; i++) {
        char *end = fields + count;
        if (sonars[i] == SONAR_UNCHANGED) count += snprintf(end, 2, ",");
        else if (sonars[i] < 0) count += snprintf(end, 3, ",-");
        else count += snprintf(end, 8, ",%d", sonars[i]);
    }
    send_fields(fields, count);
}

/* Reads an integer and the comma before it. Returns 0 if there is none in the range. */
static int read_number(const char **at, long min, long max, long *number) {
    if (**at != ',') return 0;
    char *end;
    *number = strtol(*at + 1, &end, 10);
    if (end == *at + 1 || *number < min || *number > max) return 0;
    *at = end;
    return 1;
}

/* Takes a line whose checksum is right. */
static void take(const char *fields, uint32_t now) {
    const char *at = fields + 1;
    long number, left, right;
    if (strcmp(fields, "H") == 0) {
        send_identity();
    } else if (fields[0] == 'D' && read_number(&at, 0, 65535, &number) &&
               read_number(&at, INT32_MIN, INT32_MAX, &left) && read_number(&at, INT32_MIN, INT32_MAX, &right) &&
               *at == 0 && !(has_taken && taken == (uint16_t)number)) {
        /* A line with the number of the one before is a copy: it does not feed the watchdog. */
        taken = (uint16_t)number;
        has_taken = 1;
        taken_at = now;
        is_stopped = 0;
        speeds[0] = (int32_t)left;
        speeds[1] = (int32_t)right;
    }
}

/* Takes a byte of the line. */
static void receive(char byte, uint32_t now) {
    if (byte == '$') {
        length = 0;
    } else if (length >= 0 && byte == '\n') {
        int fields = length - 5;
        line[length] = 0;
        length = -1;
        if (fields > 0 && line[fields] == '*') {
            char sum[5];
            snprintf(sum, sizeof sum, "%04X", (unsigned)checksum(line, fields));
            if (strcmp(sum, line + fields + 1) == 0) {
                line[fields] = 0;
                take(line, now);
            }
        }
    } else if (length >= 0) {
        line[length++] = byte;
        if (length >= MAX_LINE - 1) length = -1;
    }
}

void robot_setup(void) {
    board_speeds(0, 0);
    send_identity();
}

void robot_loop(void) {
    uint32_t now = board_ms();
    for (int byte = board_read(); byte >= 0; byte = board_read()) receive((char)byte, now);
    if (now - taken_at > WATCHDOG_MS) {
        is_stopped = 1;
        speeds[0] = speeds[1] = 0;
    }
    board_speeds(speeds[0], speeds[1]);
    if (now - sent_at >= PERIOD_MS) {
        sent_at = now;
        send_measurement(now);
    }
}
