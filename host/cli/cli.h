/* The command line: `trocar VERB [options]`. One file per verb, verb_NAME.c, with one function; trocar_main.c has the
 * table. A verb parses its own options with getopt_long, prints results on stdout and everything else on stderr, and
 * returns STATUS_OK or a negative status with `why` filled; the exit code follows from the status. */
#ifndef TROCAR_CLI_H
#define TROCAR_CLI_H

#include <stdbool.h>
#include <stdint.h>

#include "failure.h"

typedef int verb_function(int argc, char **argv, struct failure *why);

verb_function verb_mesh, verb_build, verb_info, verb_verify, verb_run, verb_view, verb_tradeoff, verb_explain;
verb_function verb_device, verb_busload, verb_monitor, verb_record, verb_replay, verb_bridge, verb_doctor;

/* Parse "0.214", a positive finite number of metres, or fail with STATUS_USAGE naming the option. */
int cli_positive(const char *option, const char *text, double *value, struct failure *why);
/* Parse a whole number within limits, or fail the same way. */
int cli_whole(const char *option, const char *text, uint64_t low, uint64_t high, uint64_t *value, struct failure *why);
/* An option that may be given once for each instrument, in their order: the next of BANK_MAX_INSTRUMENTS values that are NULL at
 * first. STATUS_USAGE when there is none left. */
int cli_each(const char *option, const char *argument, const char **values, struct failure *why);
/* run --bus: the host of a controller that is out there. `torque_log` NULL: none. */
struct remote_options;
int run_remote(const struct remote_options *options, bool json, struct failure *why);
/* Print a failure that is none yet: a bus that went down and may come back. */
void cli_warn(const struct failure *why);
/* After getopt_long (opterr = 0, an option string that starts with ':') returned '?' or ':': STATUS_USAGE naming the word. */
int cli_bad_option(const char *verb, int answer, char **argv, struct failure *why);

#endif
