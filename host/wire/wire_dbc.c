#include "wire_dbc.h"

int wire_dbc(struct dbc **out, struct failure *why)
{
    return dbc_parse(wire_dbc_text, "wire.dbc", out, why);
}
