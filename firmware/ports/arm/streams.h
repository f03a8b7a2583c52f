/* Lockstep (../lockstep.h) over two files or pipes of the host's, which the emulator's command line names as "IN OUT":
 * records in and out, in batches, by semihosting. */
#ifndef TROCAR_STREAMS_H
#define TROCAR_STREAMS_H

#include <stdbool.h>

#include "ports/lockstep.h"

/* 0; else the reason has been printed, and this is the exit code: 2 for a wrong call, 3 for a file that cannot be opened. */
int streams_open(void);

/* A record joins the batch that streams_flush writes. False: a full batch could not be written. */
bool streams_write(struct lockstep_record record);
bool streams_flush(void);

/* The next record, NULL at the end of the input. It stays until the next call. */
const struct lockstep_record *streams_next(void);

#endif
