/* Trocar's own protocol file, shared/wire.dbc, as it was when the program was built. */
#ifndef TROCAR_WIRE_DBC_H
#define TROCAR_WIRE_DBC_H

#include "dbc.h"

extern const char wire_dbc_text[];

/* dbc_parse of it. */
int wire_dbc(struct dbc **out, struct failure *why);

#endif
