/* Line protocol of Yamabico for a robot with two wheels (docs/line-protocol.md).
 *
 * Call robot_setup once and robot_loop as often as possible. Write the six functions below for your board. */
#ifndef ROBOT_H
#define ROBOT_H

#include <stdint.h>

#define ROBOT_NAME "reference"
/* Time without a new drive line after which the wheels are stopped, ms. */
#define WATCHDOG_MS 200
/* Time between two measurement lines, ms. */
#define PERIOD_MS 20
/* Number of sonars, at most 8. */
#define SONARS 1

/* Readings of a sonar beside a range in mm. */
#define SONAR_UNCHANGED (-1)
#define SONAR_SILENT (-2)

void robot_setup(void);
void robot_loop(void);

/* --- Yours --- */

/* Time since the start, ms. May wrap. */
uint32_t board_ms(void);
/* Next byte of the line, or -1. */
int board_read(void);
/* Sends bytes. */
void board_write(const char *bytes, int count);
/* Counters of the left and the right wheel; forward counts up. May wrap. */
void board_counts(int32_t counts[2]);
/* Speeds to hold, counts per second; both zero: brake. Called at least every PERIOD_MS. */
void board_speeds(int32_t left, int32_t right);
/* Bumpers as bits (*bumpers); range of each sonar in mm, SONAR_UNCHANGED or SONAR_SILENT. Returns nonzero if the
 * motors are switched off by hand. */
int board_sense(uint16_t *bumpers, int16_t sonars[SONARS]);

#endif
