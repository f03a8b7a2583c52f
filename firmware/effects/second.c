#include "effects/second.h"

int second_open(struct bank_view *view)
{
    const struct bank_section *section = bank_view_section(view, BANK_SCND);
    const struct bank_second *b = (const void *)((const char *)view->header + section->offset);
    if (section->count != 1 || section->length != sizeof *b || view->tool_count != 2)
        return STATUS_BANK_LENGTH;
    bool good = b->points[0] == view->tools[0].point_count && b->points[1] == view->tools[1].point_count &&
                b->points[0] + b->points[1] <= BANK_MAX_TOOL_POINTS && b->reserved[0] == 0 && b->reserved[1] == 0;
    view->second = b;
    return good ? STATUS_OK : STATUS_BANK_SECTION;
}
