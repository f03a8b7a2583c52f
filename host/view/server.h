/* HTTP and WebSocket on 127.0.0.1 through libwebsockets, in the caller's thread: nothing happens outside server_serve.
 *
 * Who may connect: this machine only (the socket is bound to 127.0.0.1), and of its browsers only pages of this server: a
 * request whose Host is not 127.0.0.1:PORT or localhost:PORT is refused with 403 (a foreign name that resolves here, DNS
 * rebinding), and so is a WebSocket whose Origin is another page's. Programs that send no Origin are let in.
 * GET and HEAD of the page's files (assets.h); WebSocket with the subprotocol "trocar-view-1".
 *
 * A client gets the greeting once, then the newest message whenever its socket takes more: at most one message per client
 * waits in memory, older ones are dropped and counted. At most SERVER_MAX_CONNECTIONS connections; further ones are
 * closed at once. */
#ifndef TROCAR_SERVER_H
#define TROCAR_SERVER_H

#include <stddef.h>
#include <stdint.h>

#include "failure.h"
#include "message.h"

enum { SERVER_MAX_CONNECTIONS = 40, SERVER_MAX_CLIENTS = 16 };

struct server_events {
    void *context;
    /* What a new client gets first; NULL closes the connection. */
    const struct message *(*greeting)(void *context);
    /* The newest message and its number, counted from 1; NULL while there is none. */
    const struct message *(*newest)(void *context, uint64_t *number);
    /* A whole text message of a client; text NULL for anything else (binary, fragments, too long). */
    void (*received)(void *context, uint64_t client, const char *text, size_t length);
    void (*gone)(void *context, uint64_t client);
};

struct server;

/* Listen on 127.0.0.1:port (0: any free port). A port in use is STATUS_VIEW_PORT. */
int server_create(uint16_t port, const struct server_events *events, struct server **server, struct failure *why);
uint16_t server_port(const struct server *server);
/* A newer message is there: offer it to every client. */
void server_notify(struct server *server);
/* Serve sockets for `wait_ms` (0: what is ready now). */
void server_serve(struct server *server, int wait_ms);
unsigned server_clients(const struct server *server); /* open WebSockets */
uint64_t server_sent(const struct server *server);    /* messages, greetings not counted */
uint64_t server_dropped(const struct server *server);
void server_free(struct server *server);

#endif
