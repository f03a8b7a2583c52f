#include "server.h"

#include <arpa/inet.h>
#include <errno.h>
#include <libwebsockets.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "assets.h"
#include "command.h"

#define SUBPROTOCOL "trocar-view-1"
#define LISTENER    "trocar-listen"
enum {
    CHUNK_BYTES = 16384, /* of a page file per turn, so that one download does not hold up the frames */
    KERNEL_BYTES =
        65536, /* that the kernel queues per client: a slow one sees frames that are this much late, not more */
};

_Static_assert((int)MESSAGE_HEADROOM >= (int)LWS_PRE, "room for libwebsockets' frame header before a message");

struct client { /* per WebSocket */
    struct client *next;
    struct lws *wsi;
    uint64_t id, sent;   /* `sent`: number of the last message */
    bool greeted, whole; /* `whole`: the message under way is text and not fragmented so far */
};

struct download { /* per HTTP request */
    const struct asset *asset;
    size_t sent;
};

union session {
    struct client client;
    struct download download;
};

struct server {
    struct lws_context *lws;
    struct lws_vhost *vhost;
    struct server_events events;
    uint16_t port;
    unsigned connections, clients;
    struct client *first;
    uint64_t next_id, sent, dropped;
    lws_sorted_usec_list_t alarm;
};

static bool is_ours(const struct server *server, const char *text, const char *scheme)
{
    char expected[64];
    static const char *const names[] = {"127.0.0.1", "localhost"};
    for (size_t i = 0; i < 2; i++) {
        snprintf(expected, sizeof expected, "%s%s:%u", scheme, names[i], server->port);
        if (strcasecmp(text, expected) == 0)
            return true;
    }
    return false;
}

/* Header of the request, "" when absent; one that does not fit is nobody's we know. */
static void header(struct lws *wsi, enum lws_token_indexes which, char text[64])
{
    text[0] = '\0';
    if (lws_hdr_total_length(wsi, which) > 0 && lws_hdr_copy(wsi, text, 64, which) < 0)
        strcpy(text, "too long");
}

static bool host_allowed(const struct server *server, struct lws *wsi)
{
    char host[64];
    header(wsi, WSI_TOKEN_HOST, host);
    return is_ours(server, host, "");
}

static bool upgrade_allowed(const struct server *server, struct lws *wsi, const char *to)
{
    char origin[64], protocol[64];
    header(wsi, WSI_TOKEN_ORIGIN, origin);
    header(wsi, WSI_TOKEN_PROTOCOL, protocol);
    return strcmp(to, "websocket") == 0 && host_allowed(server, wsi) && strcmp(protocol, SUBPROTOCOL) == 0 &&
           (origin[0] == '\0' || is_ours(server, origin, "http://")) && server->clients < SERVER_MAX_CLIENTS;
}

static int refuse(struct lws *wsi, unsigned code, const char *text)
{
    char body[200];
    snprintf(body, sizeof body, "<p>%s</p>", text);
    lws_return_http_status(wsi, code, body);
    return -1;
}

static bool add_header(struct lws *wsi, const char *name, const char *value, unsigned char **at, unsigned char *end)
{
    return lws_add_http_header_by_name(wsi, (const unsigned char *)name, (const unsigned char *)value,
                                       (int)strlen(value), at, end) == 0;
}

static bool write_headers(const struct server *server, struct lws *wsi, const struct asset *asset)
{
    unsigned char buffer[LWS_PRE + 1536], *start = buffer + LWS_PRE, *at = start, *end = buffer + sizeof buffer - 1;
    char policy[400];
    /* 'self' does not cover ws: in every browser: both names are spelled out. */
    snprintf(policy, sizeof policy,
             "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self' "
             "ws://127.0.0.1:%u ws://localhost:%u; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
             server->port, server->port);
    return lws_add_http_common_headers(wsi, HTTP_STATUS_OK, asset->type, asset->length, &at, end) == 0 &&
           add_header(wsi, "content-security-policy:", policy, &at, end) &&
           add_header(wsi, "x-content-type-options:", "nosniff", &at, end) &&
           add_header(wsi, "referrer-policy:", "no-referrer", &at, end) &&
           add_header(wsi, "cross-origin-resource-policy:", "same-origin", &at, end) &&
           add_header(wsi, "cache-control:", "no-cache", &at, end) &&
           lws_finalize_write_http_header(wsi, start, &at, end) == 0;
}

static int start_download(const struct server *server, struct lws *wsi, struct download *download, const char *path)
{
    if (!host_allowed(server, wsi))
        return refuse(wsi, HTTP_STATUS_FORBIDDEN, "This page answers only to 127.0.0.1 and localhost.");
    bool head = lws_hdr_total_length(wsi, WSI_TOKEN_HEAD_URI) > 0;
    if (!head && lws_hdr_total_length(wsi, WSI_TOKEN_GET_URI) <= 0)
        return refuse(wsi, HTTP_STATUS_METHOD_NOT_ALLOWED, "Only GET and HEAD.");
    const struct asset *asset = asset_find(path);
    if (!asset)
        return refuse(wsi, HTTP_STATUS_NOT_FOUND, "No such page.");
    if (!write_headers(server, wsi, asset))
        return -1;
    if (head)
        return lws_http_transaction_completed(wsi) ? -1 : 0;
    *download = (struct download){asset, 0};
    lws_callback_on_writable(wsi);
    return 0;
}

static int continue_download(struct lws *wsi, struct download *download)
{
    static unsigned char chunk[LWS_PRE + CHUNK_BYTES];
    const struct asset *asset = download->asset;
    if (!asset)
        return -1;
    size_t left = asset->length - download->sent;
    bool final = left <= CHUNK_BYTES;
    size_t length = final ? left : CHUNK_BYTES;
    memcpy(chunk + LWS_PRE, asset->bytes + download->sent, length);
    if (lws_write(wsi, chunk + LWS_PRE, length, final ? LWS_WRITE_HTTP_FINAL : LWS_WRITE_HTTP) < (int)length)
        return -1;
    download->sent += length;
    if (!final) {
        lws_callback_on_writable(wsi);
        return 0;
    }
    download->asset = NULL;
    return lws_http_transaction_completed(wsi) ? -1 : 0;
}

static void client_join(struct server *server, struct lws *wsi, struct client *client)
{
    *client = (struct client){.next = server->first, .wsi = wsi, .id = ++server->next_id};
    server->first = client;
    server->clients++;
    lws_callback_on_writable(wsi);
}

static void client_leave(struct server *server, const struct client *client)
{
    for (struct client **link = &server->first; *link; link = &(*link)->next)
        if (*link == client) {
            *link = client->next;
            server->clients--;
            server->events.gone(server->events.context, client->id);
            return;
        }
}

/* libwebsockets keeps what the socket does not take at once and calls again only when that is gone: so at most one message
 * waits per client, and the next one is the newest then. */
static int client_send(struct server *server, struct client *client)
{
    const struct message *message;
    uint64_t number = 0;
    if (!client->greeted) {
        message = server->events.greeting(server->events.context);
        if (!message)
            return -1;
    } else {
        message = server->events.newest(server->events.context, &number);
        if (!message || number == client->sent)
            return 0;
    }
    if (lws_write(client->wsi, message->buffer + MESSAGE_HEADROOM, message->length, LWS_WRITE_BINARY) <
        (int)message->length)
        return -1;
    if (client->greeted) {
        if (client->sent)
            server->dropped += number - client->sent - 1;
        client->sent = number;
        server->sent++;
    } else {
        client->greeted = true;
        lws_callback_on_writable(client->wsi);
    }
    return 0;
}

static void client_receive(struct server *server, struct client *client, const char *text, size_t length)
{
    bool first = lws_is_first_fragment(client->wsi), last = lws_is_final_fragment(client->wsi);
    bool complete = last && lws_remaining_packet_payload(client->wsi) == 0;
    client->whole = first && complete && !lws_frame_is_binary(client->wsi) && length <= COMMAND_MAX_BYTES;
    if (complete)
        server->events.received(server->events.context, client->id, client->whole ? text : NULL,
                                client->whole ? length : 0);
}

static void accept_all(struct server *server, int listener)
{
    for (int k = 0; k < 16; k++) { /* the rest is accepted at the next turn */
        int fd = accept4(listener, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
        if (fd < 0)
            return;
        if (server->connections >= SERVER_MAX_CONNECTIONS)
            close(fd);
        else
            lws_adopt_socket_vhost(server->vhost, fd); /* closes fd when it fails */
    }
}

static int callback(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t length)
{
    struct server *server = lws_context_user(lws_get_context(wsi));
    union session *session = user;

    switch (reason) {
    case LWS_CALLBACK_RAW_RX_FILE:
        accept_all(server, (int)(intptr_t)lws_get_socket_fd(wsi));
        return 0;
    case LWS_CALLBACK_WSI_CREATE:
        server->connections++;
        return 0;
    case LWS_CALLBACK_WSI_DESTROY:
        server->connections--;
        return 0;
    case LWS_CALLBACK_HTTP:
        return start_download(server, wsi, &session->download, in);
    case LWS_CALLBACK_HTTP_WRITEABLE:
        return continue_download(wsi, &session->download);
    case LWS_CALLBACK_HTTP_CONFIRM_UPGRADE:
        if (upgrade_allowed(server, wsi, in))
            return 0;
        refuse(wsi, HTTP_STATUS_FORBIDDEN,
               "Only this server's own page may connect, with the header Sec-WebSocket-Protocol: " SUBPROTOCOL ".");
        return -1;
    case LWS_CALLBACK_ESTABLISHED:
        client_join(server, wsi, &session->client);
        return 0;
    case LWS_CALLBACK_CLOSED:
        client_leave(server, &session->client);
        return 0;
    case LWS_CALLBACK_SERVER_WRITEABLE:
        return client_send(server, &session->client);
    case LWS_CALLBACK_RECEIVE:
        client_receive(server, &session->client, in, length);
        return 0;
    default:
        return 0;
    }
}

static const struct lws_protocols protocols[] = {{"http", callback, sizeof(union session), 1024, 0, NULL, 0},
                                                 {SUBPROTOCOL, callback, sizeof(union session), 1024, 1, NULL, 0},
                                                 {LISTENER, callback, 0, 0, 2, NULL, 0},
                                                 {NULL, NULL, 0, 0, 0, NULL, 0}};

/* The socket is ours and not libwebsockets' so that it is bound to 127.0.0.1 alone and a port in use has its own name. */
static int open_listener(uint16_t *port, int *listener, struct failure *why)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(*port)};
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof address;
    const int yes = 1, queue = KERNEL_BYTES;
    char place[32];
    snprintf(place, sizeof place, "127.0.0.1:%u", *port);

    int fd = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return failure_set(why, STATUS_VIEW_PORT, place, "", "no socket: %s", strerror(errno));
    if (setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) < 0 ||
        setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &queue, sizeof queue) < 0 || /* the accepted sockets inherit it */
        bind(fd, (struct sockaddr *)&address, sizeof address) < 0 || listen(fd, 16) < 0 ||
        getsockname(fd, (struct sockaddr *)&address, &length) < 0) {
        int cause = errno;
        close(fd);
        return failure_set(why, STATUS_VIEW_PORT, place, "", "the port cannot be listened on: %s", strerror(cause));
    }
    *port = ntohs(address.sin_port);
    *listener = fd;
    return STATUS_OK;
}

int server_create(uint16_t port, const struct server_events *events, struct server **out, struct failure *why)
{
    struct server *server = calloc(1, sizeof *server);
    if (!server)
        return failure_set(why, STATUS_MEMORY, "view", "", "no memory for the server");
    server->events = *events;
    server->port = port;
    int listener = -1;
    int status = open_listener(&server->port, &listener, why);
    if (status < 0) {
        free(server);
        return status;
    }

    lws_set_log_level(0, NULL); /* what matters is reported as a failure or seen by the client */
    struct lws_context_creation_info info = {.port = CONTEXT_PORT_NO_LISTEN,
                                             .protocols = protocols,
                                             .user = server,
                                             .gid = (gid_t)-1,
                                             .uid = (uid_t)-1,
                                             .fd_limit_per_thread = SERVER_MAX_CONNECTIONS + 8,
                                             .server_string = "trocar",
                                             .options = LWS_SERVER_OPTION_EXPLICIT_VHOSTS};
    server->lws = lws_create_context(&info);
    if (server->lws)
        server->vhost = lws_create_vhost(server->lws, &info);
    if (!server->vhost) {
        close(listener);
        server_free(server);
        return failure_set(why, STATUS_MEMORY, "view", "", "libwebsockets could not start");
    }
    lws_sock_file_fd_type fd = {.filefd = listener};
    if (!lws_adopt_descriptor_vhost(server->vhost, LWS_ADOPT_RAW_FILE_DESC, fd, LISTENER, NULL)) {
        server_free(server); /* the descriptor was closed by the failed call */
        return failure_set(why, STATUS_MEMORY, "view", "", "libwebsockets could not take the listening socket");
    }
    *out = server;
    return STATUS_OK;
}

uint16_t server_port(const struct server *server)
{
    return server->port;
}

void server_notify(struct server *server)
{
    for (struct client *client = server->first; client; client = client->next)
        lws_callback_on_writable(client->wsi);
}

static void alarm_rings(lws_sorted_usec_list_t *alarm)
{
    (void)alarm; /* its only purpose is to end lws_service's wait */
}

void server_serve(struct server *server, int wait_ms)
{
    lws_usec_t now = lws_now_usecs(), end = now + (lws_usec_t)wait_ms * 1000;
    /* lws_service waits until something happens, whatever timeout it is given; a negative one does not wait. */
    while (end - now >= 1000) {
        lws_sul_schedule(server->lws, 0, &server->alarm, alarm_rings, end - now);
        if (lws_service(server->lws, 0) < 0)
            break;
        now = lws_now_usecs();
    }
    lws_sul_schedule(server->lws, 0, &server->alarm, alarm_rings, LWS_SET_TIMER_USEC_CANCEL);
    if (wait_ms <= 0)
        lws_service(server->lws, -1);
}

unsigned server_clients(const struct server *server)
{
    return server->clients;
}

uint64_t server_sent(const struct server *server)
{
    return server->sent;
}

uint64_t server_dropped(const struct server *server)
{
    return server->dropped;
}

void server_free(struct server *server)
{
    if (!server)
        return;
    if (server->lws)
        lws_context_destroy(server->lws);
    free(server);
}
