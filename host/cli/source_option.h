/* The options of the verbs that listen: a bus by its name, or a scene whose simulated session is listened to. */
#ifndef TROCAR_SOURCE_OPTION_H
#define TROCAR_SOURCE_OPTION_H

#include <stdbool.h>

#include "frame_source.h"

enum {
    SOURCE_BUS = 0x1000,
    SOURCE_GESTURE = 'g',
    SOURCE_TICKS = 'n',
    SOURCE_DEVICE = 0x1001,
    SOURCE_FAULTS,
    SOURCE_SEED,
    SOURCE_SECONDS
};

/* For the verb's getopt_long, with "g:n:" among the short ones. */
#define SOURCE_LONG_OPTIONS                                                                                            \
    {"bus", required_argument, NULL, SOURCE_BUS}, {"gesture", required_argument, NULL, SOURCE_GESTURE},                \
        {"ticks", required_argument, NULL, SOURCE_TICKS}, {"device", required_argument, NULL, SOURCE_DEVICE},          \
        {"faults", required_argument, NULL, SOURCE_FAULTS}, {"seed", required_argument, NULL, SOURCE_SEED},            \
    {                                                                                                                  \
        "seconds", required_argument, NULL, SOURCE_SECONDS                                                             \
    }

#define SOURCE_USAGE                                                                                                   \
    "      --bus NAME       socketcan:IF, slcan:TTY, or soft (the default): the simulated bus of a session\n"          \
    "      --seconds N      end after so long\n"                                                                       \
    "of a simulated session:\n"                                                                                        \
    "  -g, --gesture G      what the hand does, as for trocar run (default press); a second one: the other hand\n"     \
    "  -n, --ticks N        so many ticks (default: the whole gesture)\n"                                              \
    "      --device NAME    the instrument\n"                                                                          \
    "      --faults LIST    faults on the bus, as for trocar run; --seed N\n"

struct source_request {
    struct frame_source_options options;
    const char *path; /* scene or bank; NULL: none */
    uint64_t seconds; /* 0: no end */
    struct bank_file bank;
    bool bank_open;
};

void source_request_start(struct source_request *request);
/* Take an answer of getopt_long: 1; 0 when it is none of these; or a failure. */
int source_option(struct source_request *request, int answer, const char *argument, struct failure *why);
/* Of a bus or of a simulated one? */
bool source_simulated(const struct source_request *request);
/* Load the bank of `path`, when there is one (a scene's is built), and open the source. source_close in any case. */
int source_open(struct source_request *request, struct frame_source **source, struct failure *why);
void source_close(struct source_request *request, struct frame_source *source);

#endif
