/* A WebSocket client of a few lines on a plain socket (RFC 6455), so that tests can also send what no library would. */
#ifndef TROCAR_VIEW_CLIENT_H
#define TROCAR_VIEW_CLIENT_H

#include <arpa/inet.h>
#include <errno.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

struct client {
    int fd;
    bool closed; /* by the other side */
    unsigned char *data;
    size_t have, used;
};

/* Address in host order. `receive_bytes` > 0 bounds the kernel's receive buffer. fd -1 when refused. */
static inline struct client client_connect(uint32_t address, uint16_t port, int receive_bytes)
{
    struct client c = {.fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)};
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(port), .sin_addr.s_addr = htonl(address)};
    if (receive_bytes > 0)
        setsockopt(c.fd, SOL_SOCKET, SO_RCVBUF, &receive_bytes, sizeof receive_bytes);
    if (connect(c.fd, (struct sockaddr *)&to, sizeof to) < 0) {
        close(c.fd);
        c.fd = -1;
    }
    return c;
}

static inline void client_close(struct client *c)
{
    if (c->fd >= 0)
        close(c->fd);
    free(c->data);
    *c = (struct client){.fd = -1};
}

static inline bool client_write(struct client *c, const void *bytes, size_t length)
{
    return send(c->fd, bytes, length, MSG_NOSIGNAL) == (ssize_t)length;
}

/* A request for a WebSocket; `origin` NULL leaves the header out. */
static inline void client_upgrade(struct client *c, const char *host, const char *origin, const char *protocol)
{
    char text[600];
    int n = snprintf(text, sizeof text,
                     "GET / HTTP/1.1\r\nHost: %s\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n%s%s%s"
                     "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
                     "Sec-WebSocket-Protocol: %s\r\n\r\n",
                     host, origin ? "Origin: " : "", origin ? origin : "", origin ? "\r\n" : "", protocol);
    client_write(c, text, (size_t)n);
}

/* One masked frame. First byte: FIN, opcode. */
static inline bool client_frame(struct client *c, unsigned first, const void *payload, size_t length)
{
    unsigned char head[14] = {(unsigned char)first};
    size_t n = 2;
    if (length < 126) {
        head[1] = (unsigned char)(0x80 | length);
    } else if (length < 65536) {
        head[1] = 0x80 | 126;
        head[n++] = (unsigned char)(length >> 8);
        head[n++] = (unsigned char)length;
    } else {
        head[1] = 0x80 | 127;
        for (int shift = 56; shift >= 0; shift -= 8)
            head[n++] = (unsigned char)((uint64_t)length >> shift);
    }
    n += 4; /* a mask of zeros leaves the payload as it is */
    return client_write(c, head, n) && (length == 0 || client_write(c, payload, length));
}

static inline bool client_text(struct client *c, const char *text)
{
    return client_frame(c, 0x81, text, strlen(text));
}

/* Take what has arrived. */
static inline void client_receive(struct client *c)
{
    for (;;) {
        c->data = realloc(c->data, c->have + 65536);
        ssize_t n = recv(c->fd, c->data + c->have, 65536, MSG_DONTWAIT);
        if (n > 0) {
            c->have += (size_t)n;
            continue;
        }
        c->closed |= n == 0 || (n < 0 && errno != EAGAIN && errno != EWOULDBLOCK);
        return;
    }
}

/* Head of the HTTP answer, consumed; NULL while it is not whole. */
static inline const char *client_head(struct client *c)
{
    unsigned char *from = c->data + c->used;
    unsigned char *end = c->have > c->used ? memmem(from, c->have - c->used, "\r\n\r\n", 4) : NULL;
    if (!end)
        return NULL;
    end[2] = '\0';
    c->used = (size_t)(end + 4 - c->data);
    return (const char *)from;
}

/* Next whole WebSocket message, consumed; NULL while there is none. */
static inline const unsigned char *client_message(struct client *c, size_t *length)
{
    const unsigned char *at = c->data + c->used;
    size_t left = c->have - c->used, head = 2;
    if (left < 2)
        return NULL;
    uint64_t n = at[1] & 127;
    if (n >= 126) {
        size_t more = n == 126 ? 2 : 8;
        head += more;
        if (left < head)
            return NULL;
        n = 0;
        for (size_t i = 0; i < more; i++)
            n = n << 8 | at[2 + i];
    }
    if (left < head + n)
        return NULL;
    c->used += head + n;
    *length = n;
    return at + head;
}

#endif
