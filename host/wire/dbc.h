/* The protocol file shared/wire.dbc, read strictly, and any frame decoded against it.
 *
 * Subset of the DBC language that is understood (whitespace is free, as in DBC):
 *
 *   VERSION "1"   NS_ : WORD...   BS_:            read and ignored
 *   BU_: NODE...                                  the nodes; senders and receivers must be among them
 *   BO_ ID NAME: LENGTH SENDER                    11-bit identifier, 0..8 bytes
 *    SG_ NAME [M|mN] : START|BITS@1(+|-) (FACTOR,OFFSET) [MINIMUM|MAXIMUM] "UNIT" RECEIVER,...
 *   CM_ ["..." | BO_ ID "..." | SG_ ID NAME "..."];
 *   VAL_ ID NAME VALUE "NAME"... ;
 *
 * `@1` is Intel order: bit i of a signal is bit (START + i) mod 8 of byte (START + i) / 8. `@0` (Motorola) is refused.
 * `M` selects the page, `mN` is present only on page N. Beyond the syntax these are errors: an identifier or name used
 * twice, two signals of one page that overlap, a bit beyond the length, a page the selector cannot hold, a factor of 0,
 * a range that the bits cannot hold (half a step is forgiven, for ranges are written rounded), a node that is not in
 * BU_. Every error is STATUS_BUS_DBC with file and line. */
#ifndef TROCAR_DBC_H
#define TROCAR_DBC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "failure.h"

enum {
    DBC_MAX_NODES = 16,
    DBC_MAX_MESSAGES = 64,
    DBC_MAX_SIGNALS = 32, /* per message */
    DBC_MAX_VALUES = 8,   /* named values per signal */
    DBC_MAX_NAME = 32,    /* characters, as DBC says */
    DBC_MAX_COMMENT = 400
};

enum dbc_kind { DBC_ALWAYS, DBC_SELECTOR, DBC_PAGED };

struct dbc_value {
    int64_t raw;
    char name[DBC_MAX_NAME + 1];
};

struct dbc_signal {
    char name[DBC_MAX_NAME + 1];
    enum dbc_kind kind;
    unsigned page;        /* DBC_PAGED */
    unsigned start, bits; /* bits 1..32 */
    bool is_signed;
    double factor, offset, minimum, maximum; /* physical = raw factor + offset */
    char unit[DBC_MAX_NAME + 1];
    uint32_t receivers; /* bit per node of BU_ */
    long line;
    size_t value_count;
    struct dbc_value value[DBC_MAX_VALUES];
};

struct dbc_message {
    uint32_t id;
    char name[DBC_MAX_NAME + 1];
    unsigned length; /* bytes */
    unsigned sender; /* index into node */
    long line;
    char comment[DBC_MAX_COMMENT + 1];
    size_t signal_count;
    struct dbc_signal signal[DBC_MAX_SIGNALS];
};

struct dbc {
    size_t node_count, message_count;
    char node[DBC_MAX_NODES][DBC_MAX_NAME + 1];
    char comment[DBC_MAX_COMMENT + 1];
    struct dbc_message message[DBC_MAX_MESSAGES];
};

/* Parse NUL-terminated text; `file` is for messages. *out is allocated (about 1 MiB), NULL after a failure.
 * STATUS_BUS_DBC, STATUS_MEMORY. */
int dbc_parse(const char *text, const char *file, struct dbc **out, struct failure *why);
/* The same from a file; also STATUS_FILE_OPEN, STATUS_FILE_READ. */
int dbc_read(const char *path, struct dbc **out, struct failure *why);
void dbc_free(struct dbc *dbc);

/* The file lists node 1. A message whose identifier ends in node 1 (low seven bits) exists for every node at base +
 * node; any other identifier stands for itself. Returns the base in the first case, the identifier in the second. */
uint32_t dbc_base(const struct dbc_message *message, bool *per_node);

/* The message that a frame with this identifier carries, and of which node (0: none); NULL when the file has none. */
const struct dbc_message *dbc_find(const struct dbc *dbc, uint32_t id, unsigned *node);

struct dbc_reading {
    const struct dbc_signal *signal;
    int64_t raw;
    double value;     /* physical, in signal->unit */
    const char *name; /* of the value, NULL when it has none */
};

/* Signals that are present in these bytes, in the file's order; 0 when the length is not the message's or the page is
 * not in the file. */
size_t dbc_decode(const struct dbc_message *message, const uint8_t *data, size_t length,
                  struct dbc_reading reading[DBC_MAX_SIGNALS]);

#endif
