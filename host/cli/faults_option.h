/* The option --faults of the verbs that simulate a bus: drop=P,duplicate=P,corrupt=P,reorder=P,delay=P (probabilities per
 * frame), delay_us=N, from=ID,to=ID (only these identifiers). */
#ifndef TROCAR_FAULTS_OPTION_H
#define TROCAR_FAULTS_OPTION_H

#include "bus.h"
#include "failure.h"

/* What `list` names is set in `faults`, the rest stays. STATUS_USAGE. */
int faults_option(const char *list, struct bus_faults *faults, struct failure *why);

#endif
