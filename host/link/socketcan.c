#include "socketcan.h"

#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <linux/can.h>
#include <linux/can/error.h>

_Static_assert(sizeof(struct can_frame) == SOCKETCAN_CLASSIC_BYTES, "linux/can.h");
_Static_assert(sizeof(struct canfd_frame) == SOCKETCAN_FD_BYTES, "linux/can.h");

size_t socketcan_pack(const struct can_frame_t *frame, unsigned char bytes[SOCKETCAN_FD_BYTES])
{
    uint32_t id = frame->id;
    id |= frame->flags & CAN_FLAG_EXTENDED ? CAN_EFF_FLAG : 0;
    if (frame->flags & CAN_FLAG_FD) {
        struct canfd_frame fd = {.can_id = id, .len = frame->length};
        memcpy(fd.data, frame->data, frame->length);
        memcpy(bytes, &fd, sizeof fd);
        return sizeof fd;
    }
    id |= frame->flags & CAN_FLAG_RTR ? CAN_RTR_FLAG : 0;
    id |= frame->flags & CAN_FLAG_ERROR ? CAN_ERR_FLAG : 0;
    struct can_frame classic = {.can_id = id, .len = frame->length};
    if (!(frame->flags & CAN_FLAG_RTR))
        memcpy(classic.data, frame->data, frame->length);
    memcpy(bytes, &classic, sizeof classic);
    return sizeof classic;
}

bool socketcan_unpack(const unsigned char *bytes, size_t length, struct can_frame_t *frame)
{
    struct canfd_frame k = {0}; /* the two share their first 16 bytes, but for the place of flags */
    if (length != CAN_MTU && length != CANFD_MTU)
        return false;
    memcpy(&k, bytes, length);
    const bool fd = length == CANFD_MTU;
    if (k.len > (fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN))
        return false;
    *frame = (struct can_frame_t){.length = k.len, .flags = fd ? CAN_FLAG_FD : 0};
    if (k.can_id & CAN_ERR_FLAG) {
        frame->flags |= CAN_FLAG_ERROR;
        frame->id = k.can_id & CAN_ERR_MASK;
    } else if (k.can_id & CAN_EFF_FLAG) {
        frame->flags |= CAN_FLAG_EXTENDED;
        frame->id = k.can_id & CAN_EFF_MASK;
    } else {
        frame->id = k.can_id & CAN_SFF_MASK;
    }
    if (k.can_id & CAN_RTR_FLAG && !fd && !(k.can_id & CAN_ERR_FLAG))
        frame->flags |= CAN_FLAG_RTR;
    else
        memcpy(frame->data, k.data, k.len);
    return true;
}

void socketcan_count_error(const struct can_frame_t *frame, struct backend_counters *c)
{
    const uint32_t class = frame->id;
    const unsigned state = class & CAN_ERR_CRTL ? frame->data[1] : 0;
    c->errors++;
    c->bus_off += (class & CAN_ERR_BUSOFF) != 0;
    c->restarted += (class & CAN_ERR_RESTARTED) != 0;
    c->no_acknowledge += (class & CAN_ERR_ACK) != 0;
    c->arbitration_lost += (class & CAN_ERR_LOSTARB) != 0;
    c->timeouts += (class & CAN_ERR_TX_TIMEOUT) != 0;
    c->overflows += (state & (CAN_ERR_CRTL_RX_OVERFLOW | CAN_ERR_CRTL_TX_OVERFLOW)) != 0;
    c->warnings += (state & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0;
    c->passive += (state & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0;
}

const char *socketcan_error_text(const struct can_frame_t *frame, char *text, size_t size)
{
    static const struct {
        uint32_t class;
        unsigned state; /* of data[1], with CAN_ERR_CRTL */
        const char *words;
    } words[] = {
        {CAN_ERR_BUSOFF, 0, "bus off"},
        {CAN_ERR_RESTARTED, 0, "restarted"},
        {CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE | CAN_ERR_CRTL_RX_PASSIVE, "error passive"},
        {CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING | CAN_ERR_CRTL_RX_WARNING, "error warning"},
        {CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW, "the controller's receive buffer overflowed"},
        {CAN_ERR_CRTL, CAN_ERR_CRTL_TX_OVERFLOW, "the controller's transmit buffer overflowed"},
        {CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE, "error active again"},
        {CAN_ERR_TX_TIMEOUT, 0, "a frame could not be sent in time"},
        {CAN_ERR_ACK, 0, "nobody acknowledges"},
        {CAN_ERR_LOSTARB, 0, "arbitration lost"},
        {CAN_ERR_PROT, 0, "protocol violation"},
        {CAN_ERR_TRX, 0, "transceiver fault"},
        {CAN_ERR_BUSERROR, 0, "bus error"},
    };
    size_t n = 0;
    if (size > 0)
        text[0] = '\0';
    for (size_t i = 0; i < sizeof words / sizeof words[0] && n < size; i++)
        if (frame->id & words[i].class && (words[i].state == 0 || frame->data[1] & words[i].state))
            n += (size_t)snprintf(text + n, size - n, "%s%s", n ? ", " : "", words[i].words);
    if (n == 0)
        snprintf(text, size, "error frame of class 0x%x", (unsigned)frame->id);
    else if (n < size && frame->length == 8 && frame->data[6] | frame->data[7])
        snprintf(text + n, size - n, " (transmit errors %u, receive errors %u)", frame->data[6], frame->data[7]);
    return text;
}
