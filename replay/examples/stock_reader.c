// Reads an LCM event log with liblcm, for throughput.rs: prints events, bytes of data and nanoseconds.

#define _POSIX_C_SOURCE 200809L
#include <inttypes.h>
#include <lcm/lcm.h>
#include <stdio.h>
#include <time.h>

static int64_t now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

int main(int argc, char **argv) {
    if (argc != 2) return 2;
    int64_t begin = now(), events = 0, bytes = 0;
    lcm_eventlog_t *log = lcm_eventlog_create(argv[1], "r");
    if (log == NULL) return 1;
    for (lcm_eventlog_event_t *e; (e = lcm_eventlog_read_next_event(log)) != NULL; lcm_eventlog_free_event(e)) {
        events++;
        bytes += e->datalen;
    }
    lcm_eventlog_destroy(log);
    printf("%" PRId64 " %" PRId64 " %" PRId64 "\n", events, bytes, now() - begin);
    return 0;
}
