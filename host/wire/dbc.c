#include "dbc.h"

uint32_t dbc_base(const struct dbc_message *m, bool *per_node)
{
    *per_node = (m->id & 0x7f) == 1;
    return *per_node ? m->id - 1 : m->id;
}

const struct dbc_message *dbc_find(const struct dbc *dbc, uint32_t id, unsigned *of_node)
{
    *of_node = 0;
    if (id > 0x7ff)
        return NULL;
    const struct dbc_message *found = NULL;
    for (size_t i = 0; i < dbc->message_count; i++) {
        const struct dbc_message *m = &dbc->message[i];
        bool per_node;
        const uint32_t base = dbc_base(m, &per_node);
        if (!per_node && m->id == id)
            return m; /* an identifier of its own goes before base + node */
        if (per_node && (id & 0x7f) != 0 && base == (id & 0x780u))
            found = m;
    }
    if (found)
        *of_node = id & 0x7f;
    return found;
}

static int64_t raw_value(const struct dbc_signal *signal, uint64_t bits)
{
    const uint64_t mask = (UINT64_C(1) << signal->bits) - 1, sign = UINT64_C(1) << (signal->bits - 1);
    const uint64_t value = bits >> signal->start & mask;
    return signal->is_signed && (value & sign) ? (int64_t)value - (int64_t)(mask + 1) : (int64_t)value;
}

size_t dbc_decode(const struct dbc_message *m, const uint8_t *data, size_t length,
                  struct dbc_reading reading[DBC_MAX_SIGNALS])
{
    if (length != m->length)
        return 0;
    uint64_t bits = 0;
    for (size_t i = 0; i < length; i++)
        bits |= (uint64_t)data[i] << 8 * i;
    bool paged = false, page_known = false;
    int64_t page = -1;
    for (size_t i = 0; i < m->signal_count; i++)
        if (m->signal[i].kind == DBC_SELECTOR) {
            paged = true;
            page = raw_value(&m->signal[i], bits);
        }
    size_t count = 0;
    for (size_t i = 0; i < m->signal_count; i++) {
        const struct dbc_signal *signal = &m->signal[i];
        if (signal->kind == DBC_PAGED) {
            if ((int64_t)signal->page != page)
                continue;
            page_known = true;
        }
        struct dbc_reading *r = &reading[count++];
        r->signal = signal;
        r->raw = raw_value(signal, bits);
        r->value = (double)r->raw * signal->factor + signal->offset;
        r->name = NULL;
        for (size_t v = 0; v < signal->value_count; v++)
            if (signal->value[v].raw == r->raw)
                r->name = signal->value[v].name;
    }
    return paged && !page_known ? 0 : count;
}
