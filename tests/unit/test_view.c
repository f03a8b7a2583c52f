/* The page's server with clients on plain sockets: what they get, and that none of them can disturb the run. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#include "bank_fixture.h"
#include "command.h"
#include "message.h"
#include "safety.h"
#include "view.h"
#include "view_client.h"

#include <json-c/json.h>

static struct bank_file bank;
static struct view *view;
static struct link heard, heard_second;
static double now_s;
static uint32_t instruments; /* that are shown; the bank has two */
static struct controller inside;

static int setup(void **state)
{
    (void)state;
    struct failure why;
    struct bank_fixture_options options = bank_fixture_default;
    options.instruments = 2;
    options.grasp_slip_N = 2;
    bank.bytes = bank_fixture(&options, &bank.length);
    assert_int_equal(bank_view_open(&bank.view, bank.bytes, bank.length), STATUS_OK);
    assert_int_equal(view_create(&bank, 0, &view, &why), STATUS_OK);
    link_start(&heard, 1);
    link_start(&heard_second, 2);
    heard.state = SAFETY_RUN;
    now_s = 0;
    instruments = 1;
    memset(&inside, 0, sizeof inside);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    view_free(view);
    free(bank.bytes);
    memset(&bank, 0, sizeof bank);
    return 0;
}

static void update(void)
{
    view_update(view, &(struct view_now){.time_s = now_s,
                                         .instruments = instruments,
                                         .link = {&heard, &heard_second},
                                         .hand_target_m = {{0, 0, 0.1}, {0, 0, 0.11}},
                                         .controller = &inside});
}

/* One frame of the run, and a turn of the sockets. */
static void frame(void)
{
    now_s += 1.0 / VIEW_RATE_HZ;
    heard.pose_time_us = heard.heartbeat_time_us = (uint64_t)(1e6 * now_s);
    update();
    view_serve(view, 0);
}

static const char *host(void)
{
    static char name[40];
    snprintf(name, sizeof name, "127.0.0.1:%u", view_port(view));
    return name;
}

static struct client join(int receive_bytes)
{
    struct client c = client_connect(INADDR_LOOPBACK, view_port(view), receive_bytes);
    assert_true(c.fd >= 0);
    client_upgrade(&c, host(), NULL, "trocar-view-1");
    const char *head = NULL;
    for (int turn = 0; turn < 500 && !head; turn++) {
        view_serve(view, 2);
        client_receive(&c);
        head = client_head(&c);
    }
    assert_non_null(head);
    assert_memory_equal(head, "HTTP/1.1 101", 12);
    return c;
}

/* The next message of a kind; its JSON (json_object_put it), and what follows that. */
static struct json_object *next(struct client *c, uint32_t kind, const unsigned char **rest, size_t *rest_length)
{
    for (int turn = 0; turn < 500; turn++) {
        size_t length;
        const unsigned char *message = client_message(c, &length);
        if (!message) {
            view_serve(view, 2);
            client_receive(c);
            continue;
        }
        uint32_t head[2];
        assert_true(length >= 8);
        memcpy(head, message, 8);
        assert_int_equal(head[1] % 4, 0);
        assert_true(8 + head[1] <= length);
        if (head[0] != kind)
            continue;
        struct json_tokener *tokener = json_tokener_new();
        json_tokener_set_flags(tokener, JSON_TOKENER_STRICT);
        struct json_object *json = json_tokener_parse_ex(tokener, (const char *)message + 8, (int)head[1]);
        assert_non_null(json);
        json_tokener_free(tokener);
        *rest = message + 8 + head[1];
        *rest_length = length - 8 - head[1];
        return json;
    }
    fail_msg("no message of kind %u came", kind);
    return NULL;
}

static double number(struct json_object *json, const char *key)
{
    struct json_object *value;
    assert_true(json_object_object_get_ex(json, key, &value));
    return json_object_get_double(value);
}

/* What a message says of an instrument. */
static struct json_object *of(struct json_object *json, size_t instrument)
{
    struct json_object *list;
    assert_true(json_object_object_get_ex(json, "instruments", &list));
    return json_object_array_get_idx(list, instrument);
}

static double frame_number(struct client *c)
{
    const unsigned char *rest;
    size_t length;
    struct json_object *json = next(c, MESSAGE_FRAME, &rest, &length);
    double n = number(json, "frame");
    json_object_put(json);
    return n;
}

/* Serve until the counter has risen to `wanted`. */
static void until(uint64_t (*counter)(const struct view *), uint64_t wanted)
{
    for (int turn = 0; turn < 500 && counter(view) < wanted; turn++)
        view_serve(view, 2);
    assert_int_equal(counter(view), wanted);
}

static void press(void)
{
    heard.contact_count = 2;
    for (unsigned c = 0; c < 2; c++)
        heard.contact[c] = (struct link_contact){7 + 30 * c, {0.25, 0.5}, {0.001, 0.002 * c, -0.012}};
    heard.tip_m[2] = 0.05;
    heard.force_N[2] = 1.25;
}

static void a_page_gets_the_rest_shape_and_then_the_field_of_the_contacts(void **state)
{
    (void)state;
    const struct bank_view *b = &bank.view;
    size_t n = b->vertex_count, t = b->triangle_count, length;
    const unsigned char *rest;
    struct client c = join(0);
    struct json_object *json = next(&c, MESSAGE_HELLO, &rest, &length);
    assert_int_equal(number(json, "vertices"), n);
    assert_int_equal(number(json, "triangles"), t);
    assert_int_equal(length, 12 * n + 6 * t + n);
    assert_memory_equal(rest, b->positions, 12 * n);
    for (size_t i = 0; i < t; i++)
        assert_memory_equal(rest + 12 * n + 6 * i, b->triangles[i].vertex, 6);
    for (size_t v = 0; v < n; v++)
        assert_int_equal(rest[12 * n + 6 * t + v], b->row_of[v] == BANK_NONE);
    json_object_put(json);

    press();
    frame();
    json = next(&c, MESSAGE_FRAME, &rest, &length);
    assert_int_equal(length, 6 * n);
    double *u = calloc(3 * n, sizeof *u), weights[4], displacement[6], scale = number(json, "scale_m"), largest = 0;
    const uint32_t triangles[2] = {7, 37};
    for (unsigned k = 0; k < 2; k++) {
        memcpy(weights + 2 * k, heard.contact[k].weights, sizeof heard.contact[k].weights);
        memcpy(displacement + 3 * k, heard.contact[k].displacement_m, sizeof heard.contact[k].displacement_m);
    }
    struct failure why;
    assert_int_equal(field_from_contacts(b, 2, triangles, weights, displacement, u, NULL, &why), STATUS_OK);
    for (size_t i = 0; i < 3 * n; i++) {
        int16_t packed;
        memcpy(&packed, rest + 2 * i, 2);
        /* half a unit of rounding, and the nine digits of scale_m in JSON */
        assert_true(fabs(packed * scale - u[i]) <= scale * (0.5 + 32767 * 1e-8));
    }
    for (size_t v = 0; v < n; v++)
        largest = fmax(largest, sqrt(u[3 * v] * u[3 * v] + u[3 * v + 1] * u[3 * v + 1] + u[3 * v + 2] * u[3 * v + 2]));
    assert_true(largest > 0.001);
    assert_true(fabs(number(json, "max_m") - largest) < 1e-8 * largest);
    json_object_put(json);
    free(u);
    client_close(&c);
}

static void two_pages_get_the_same_frames(void **state)
{
    (void)state;
    struct client a = join(0), b = join(0);
    press();
    for (int k = 1; k <= 20; k++) {
        frame();
        assert_int_equal(frame_number(&a), k);
        assert_int_equal(frame_number(&b), k);
    }
    assert_int_equal(view_clients(view), 2);
    assert_int_equal(view_frames_sent(view), 40);
    assert_int_equal(view_frames_dropped(view), 0);
    client_close(&a);
    client_close(&b);
}

static void frames_leave_thirty_times_per_second_of_the_run(void **state)
{
    (void)state;
    struct client c = join(0);
    for (int tick = 1; tick <= 2000; tick++) {
        now_s = 1e-3 * tick;
        update();
        view_serve(view, 0);
        client_receive(&c);
    }
    double last = 0;
    for (size_t length; client_message(&c, &length);)
        last++;
    /* the hello, and a frame at the first tick and then every 33 1/3 ms */
    assert_in_range((int)last, 60, 62);
    client_close(&c);
}

static void a_slow_page_loses_frames_and_holds_nobody_up(void **state)
{
    (void)state;
    struct client slow = join(4096), quick = join(0);
    press();
    for (int k = 1; k <= 600; k++) {
        frame();
        assert_int_equal(frame_number(&quick), k);
    }
    /* What waits for the slow one: the two kernel buffers (at most 2 x 64 KiB and 2 x 4 KiB) and one message. */
    double first = frame_number(&slow), before = first, gap = 0;
    int got = 1;
    while (before < 600) {
        double n = frame_number(&slow);
        assert_true(n > before);
        gap = fmax(gap, n - before);
        before = n;
        got++;
    }
    assert_true(first < 10);
    assert_true(gap > 300);
    assert_true(got < 200);
    assert_true(view_frames_dropped(view) >= 300);
    client_close(&slow);
    client_close(&quick);
}

static void what_a_page_should_not_send_is_counted_and_ignored(void **state)
{
    (void)state;
    static const char *const bad[] = {"",
                                      "{",
                                      "null",
                                      "[]",
                                      "{}",
                                      "{\"do\":\"quit\"",
                                      "{\"do\":\"explode\"}",
                                      "{\"do\":1}",
                                      "{\"hand\":[1,2]}",
                                      "{\"hand\":[1,2,\"3\"]}",
                                      "{\"hand\":[0,0,NaN]}",
                                      "{\"hand\":[0,0,1e999]}",
                                      "{\"hand\":[0,0,7]}",
                                      "{\"hand\":[0,0,0.1],\"do\":\"quit\"}",
                                      "{\"hand\":[0,0,0.1],\"instrument\":2}",
                                      "{\"hand\":[0,0,0.1],\"instrument\":-1}",
                                      "{\"hand\":[0,0,0.1],\"instrument\":0.5}",
                                      "{\"hand\":[0,0,0.1],\"instrument\":null}",
                                      "{\"instrument\":0}",
                                      "{\"do\":\"quit\",\"instrument\":0}",
                                      "{\"hand\":[[[[[[[[0]]]]]]]]}",
                                      "{\"do\":\"quit\"} x"};
    struct client c = join(0), good = join(0);
    uint64_t count = 0;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_true(client_text(&c, bad[i]));
        count++;
    }
    until(view_malformed, count);

    static char huge[70000];
    memset(huge, '{', sizeof huge);
    assert_true(client_frame(&c, 0x82, "\0\1\2", 3)); /* binary */
    assert_true(client_frame(&c, 0x81, huge, 600));   /* too long */
    assert_true(client_frame(&c, 0x81, huge, 20000)); /* in several reads */
    until(view_malformed, count + 3);
    assert_true(client_frame(&c, 0x01, "{\"do\":", 6)); /* in fragments */
    assert_true(client_frame(&c, 0x80, "\"quit\"}", 7));
    until(view_malformed, count + 4);

    struct view_input input;
    view_input(view, &input);
    assert_false(input.quit || input.stop || input.acknowledge || input.hand[0].overridden || input.hand[1].overridden);
    frame();
    assert_int_equal(frame_number(&good), 1);
    assert_int_equal(frame_number(&c), 1);
    client_close(&c);
    client_close(&good);
}

/* Bytes that are no HTTP, no WebSocket, or stop in the middle. */
static void garbage_on_the_wire_does_not_disturb_others(void **state)
{
    (void)state;
    struct client good = join(0);
    uint32_t seed = 20240229;
    print_message("# seed %u\n", seed);
    for (int k = 0; k < 60; k++) {
        struct client c = k % 3 ? client_connect(INADDR_LOOPBACK, view_port(view), 0) : join(0);
        assert_true(c.fd >= 0);
        unsigned char noise[400];
        for (size_t i = 0; i < sizeof noise; i++) {
            seed = seed * 1664525u + 1013904223u;
            noise[i] = (unsigned char)(seed >> 24);
        }
        if (k % 3 == 1)
            memcpy(noise, "GET / HTTP/1.1\r\nHost: ", 22);
        client_write(&c, noise, 1 + seed % sizeof noise);
        view_serve(view, 1);
        client_close(&c);
        frame();
        frame_number(&good);
    }
    client_close(&good);
}

static void refused(const char *hostname, const char *origin, const char *protocol)
{
    struct client c = client_connect(INADDR_LOOPBACK, view_port(view), 0);
    client_upgrade(&c, hostname, origin, protocol);
    const char *head = NULL;
    for (int turn = 0; turn < 500 && !head && !c.closed; turn++) {
        view_serve(view, 2);
        client_receive(&c);
        head = client_head(&c);
    }
    if (!head || strncmp(head + strlen("HTTP/1.x "), "403", 3) != 0)
        fail_msg("host %s, origin %s: %s", hostname, origin ? origin : "none", head ? head : "no answer");
    client_close(&c);
}

static void a_foreign_page_is_refused(void **state)
{
    (void)state;
    char own[60], other[60], named[60];
    snprintf(own, sizeof own, "http://%s", host());
    snprintf(named, sizeof named, "localhost:%u", view_port(view));
    snprintf(other, sizeof other, "127.0.0.1:%u", view_port(view) ^ 1);
    refused(host(), "http://example.org", "trocar-view-1");
    refused(host(), "null", "trocar-view-1");
    refused(host(), "http://127.0.0.1.example.org", "trocar-view-1");
    refused(host(), own, "chat");
    refused("example.org", NULL, "trocar-view-1"); /* a name that was made to resolve here */
    refused("127.0.0.1", NULL, "trocar-view-1");
    refused(other, own, "trocar-view-1");
    assert_int_equal(view_clients(view), 0);

    const char *const allowed[][2] = {{host(), own}, {named, NULL}};
    for (int k = 0; k < 2; k++) {
        struct client c = client_connect(INADDR_LOOPBACK, view_port(view), 0);
        client_upgrade(&c, allowed[k][0], allowed[k][1], "trocar-view-1");
        const unsigned char *rest;
        size_t length;
        for (int turn = 0; turn < 500 && !client_head(&c); turn++) {
            view_serve(view, 2);
            client_receive(&c);
        }
        json_object_put(next(&c, MESSAGE_HELLO, &rest, &length));
        client_close(&c);
    }
}

static void files_are_served_to_the_own_host_only(void **state)
{
    (void)state;
    const struct {
        const char *request, *host, *answer;
    } cases[] = {{"GET /", host(), "HTTP/1.1 200"},         {"GET /three.min.js", host(), "HTTP/1.1 200"},
                 {"HEAD /view.js", host(), "HTTP/1.1 200"}, {"GET /nothing", host(), "HTTP/1.1 404"},
                 {"GET /../view.c", host(), "HTTP/1.1 40"}, {"POST /", host(), "HTTP/1.1 405"},
                 {"GET /", "example.org", "HTTP/1.1 403"}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        struct client c = client_connect(INADDR_LOOPBACK, view_port(view), 0);
        char text[300];
        int n = snprintf(text, sizeof text, "%s HTTP/1.1\r\nHost: %s\r\nContent-Length: 0\r\nConnection: close\r\n\r\n",
                         cases[k].request, cases[k].host);
        client_write(&c, text, (size_t)n);
        const char *head = NULL;
        for (int turn = 0; turn < 500 && !head && !c.closed; turn++) {
            view_serve(view, 2);
            client_receive(&c);
            head = client_head(&c);
        }
        if (!head || strncmp(head, cases[k].answer, strlen(cases[k].answer)) != 0)
            fail_msg("%s of %s: %s", cases[k].request, cases[k].host, head ? head : "no answer");
        if (k == 0)
            assert_non_null(strstr(head, "content-security-policy: default-src 'none'"));
        client_close(&c);
    }
}

static void only_the_loopback_address_listens(void **state)
{
    (void)state;
    /* 127.0.0.2 is this machine too; a socket bound to any address would answer on it */
    struct client c = client_connect(INADDR_LOOPBACK + 1, view_port(view), 0);
    assert_int_equal(c.fd, -1);
    client_close(&c);
}

static void a_port_in_use_is_named(void **state)
{
    (void)state;
    struct view *second = NULL;
    struct failure why;
    assert_int_equal(view_create(&bank, view_port(view), &second, &why), STATUS_VIEW_PORT);
    assert_null(second);
    assert_string_equal(why.place, host());
    assert_non_null(strstr(why.cause, "in use"));
    assert_non_null(strstr(status_remedy(why.status), "--port"));
}

static void the_hand_follows_a_page_within_reach_and_is_let_go_when_it_leaves(void **state)
{
    (void)state;
    const struct bank_axis *insertion = &bank.view.tools->axis[2];
    struct client c = join(0), other = join(0);
    struct view_input input = {0};
    assert_true(client_text(&c, "{\"hand\":[0.01,-0.02,0.1]}"));
    for (int turn = 0; turn < 500 && !input.hand[0].overridden; turn++) {
        view_serve(view, 2);
        view_input(view, &input);
    }
    assert_true(input.hand[0].overridden);
    assert_float_equal(input.hand[0].target_m[0], 0.01, 1e-12);
    assert_float_equal(input.hand[0].target_m[1], -0.02, 1e-12);
    assert_float_equal(input.hand[0].target_m[2], 0.1, 1e-12);

    assert_true(client_text(&c, "{\"hand\":[1,0,-1]}"));
    assert_true(client_text(&c, "{\"do\":\"stop\"}")); /* arrives after it */
    for (int turn = 0; turn < 500 && !input.stop; turn++) {
        view_serve(view, 2);
        view_input(view, &input);
    }
    double x = input.hand[0].target_m[0], z = input.hand[0].target_m[2], length = sqrt(x * x + z * z);
    assert_float_equal(input.hand[0].target_m[1], 0, 1e-12);
    assert_true(z > 0);
    assert_float_equal(length, (double)insertion->maximum, 1e-9);
    assert_float_equal(x / length, sin((double)bank.view.tools->axis[0].maximum), 1e-9);
    view_input(view, &input);
    assert_false(input.stop); /* once */
    assert_true(input.hand[0].overridden);

    client_close(&other); /* another page's end changes nothing */
    for (int turn = 0; turn < 500 && view_clients(view) > 1; turn++)
        view_serve(view, 2);
    view_input(view, &input);
    assert_true(input.hand[0].overridden);
    client_close(&c);
    for (int turn = 0; turn < 500 && view_clients(view) > 0; turn++)
        view_serve(view, 2);
    view_input(view, &input);
    assert_false(input.hand[0].overridden);
}

static void numbers_that_are_not_finite_and_foreign_contacts_are_left_out(void **state)
{
    (void)state;
    struct client c = join(0);
    press();
    heard.force_N[0] = NAN;
    heard.tip_m[1] = INFINITY;
    heard.contact[1].triangle = 1u << 16; /* of another bank */
    frame();
    const unsigned char *rest;
    size_t length;
    struct json_object *json = next(&c, MESSAGE_FRAME, &rest, &length), *force, *contacts;
    json_object_object_get_ex(of(json, 0), "force_N", &force);
    json_object_object_get_ex(of(json, 0), "contacts", &contacts);
    assert_null(json_object_array_get_idx(force, 0));
    assert_float_equal(json_object_get_double(json_object_array_get_idx(force, 2)), 1.25, 1e-12);
    assert_int_equal(json_object_array_length(contacts), 1);
    json_object_put(json);
    client_close(&c);
}

static void each_instrument_has_its_own_force_and_hand(void **state)
{
    (void)state;
    struct client c = join(0);
    const unsigned char *rest;
    size_t length;
    struct json_object *json = next(&c, MESSAGE_HELLO, &rest, &length), *value;
    for (size_t t = 0; t < 2; t++) {
        json_object_object_get_ex(of(json, t), "trocar_m", &value);
        for (size_t a = 0; a < 3; a++)
            assert_float_equal(json_object_get_double(json_object_array_get_idx(value, a)),
                               (double)bank.view.tools[t].trocar_m[a], 1e-8);
    }
    json_object_put(json);

    instruments = 2;
    press();
    heard_second.force_N[0] = -0.5;
    heard_second.grip = BANK_MAX_GRIP;
    frame();
    json = next(&c, MESSAGE_FRAME, &rest, &length);
    for (size_t t = 0; t < 2; t++) {
        json_object_object_get_ex(of(json, t), "force_N", &value);
        assert_float_equal(json_object_get_double(json_object_array_get_idx(value, t ? 0 : 2)), t ? -0.5 : 1.25, 1e-12);
        assert_float_equal(number(of(json, t), "grip"), t, 1e-12);
    }
    json_object_put(json);

    struct view_input input = {0};
    assert_true(client_text(&c, "{\"hand\":[0.01,0,0.1],\"instrument\":1}"));
    for (int turn = 0; turn < 500 && !input.hand[1].overridden; turn++) {
        view_serve(view, 2);
        view_input(view, &input);
    }
    assert_true(input.hand[1].overridden);
    assert_false(input.hand[0].overridden);
    assert_float_equal(input.hand[1].target_m[0], 0.01, 1e-12);
    assert_true(client_text(&c, "{\"hand\":null,\"instrument\":1}"));
    for (int turn = 0; turn < 500 && input.hand[1].overridden; turn++) {
        view_serve(view, 2);
        view_input(view, &input);
    }
    assert_false(input.hand[1].overridden);
    client_close(&c);
}

/* A held point is drawn at its place on the surface, and belongs to the instrument whose point of the tool it is. */
static void points_that_the_jaws_hold_are_shown_where_the_tissue_is(void **state)
{
    (void)state;
    const struct bank_view *b = &bank.view;
    const uint32_t first_of_second = b->tools[0].point_count;
    struct client c = join(0);
    instruments = 2;
    press();
    inside.grasp.point[first_of_second] =
        (struct grasp_point){.held = true, .triangle = 7, .weights = {0.25f, 0.25f, 0.5f}};
    frame();
    const unsigned char *rest;
    size_t length;
    struct json_object *json = next(&c, MESSAGE_FRAME, &rest, &length), *held, *none;
    json_object_object_get_ex(of(json, 1), "held", &held);
    json_object_object_get_ex(of(json, 0), "held", &none);
    assert_int_equal(json_object_array_length(none), 0);
    assert_int_equal(json_object_array_length(held), 1);
    /* contact 0 of press() has the same anchor, and the field passes through its displacement to within the regularisation */
    const double *d = heard.contact[0].displacement_m;
    for (size_t a = 0; a < 3; a++) {
        double wanted = d[a], x;
        for (size_t k = 0; k < 3; k++)
            wanted += (double[3]){0.25, 0.25, 0.5}[k] * (double)b->positions[3 * b->triangles[7].vertex[k] + a];
        x = json_object_get_double(json_object_array_get_idx(json_object_array_get_idx(held, 0), a));
        assert_float_equal(x, wanted, 2e-4);
    }
    json_object_put(json);
    client_close(&c);
}

static void more_connections_than_allowed_are_closed(void **state)
{
    (void)state;
    struct client first = join(0), many[60];
    for (int k = 0; k < 60; k++) {
        many[k] = client_connect(INADDR_LOOPBACK, view_port(view), 0);
        view_serve(view, 0);
    }
    frame();
    assert_int_equal(frame_number(&first), 1);
    int closed = 0;
    for (int k = 0; k < 60; k++) {
        client_receive(&many[k]);
        closed += many[k].fd < 0 || many[k].closed;
        client_close(&many[k]);
    }
    assert_true(closed >= 60 - 40 && closed < 60);
    struct client again;
    for (int turn = 0; turn < 50; turn++)
        view_serve(view, 1);
    again = join(0); /* room again */
    client_close(&again);
    client_close(&first);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        TEST(a_page_gets_the_rest_shape_and_then_the_field_of_the_contacts),
        TEST(two_pages_get_the_same_frames),
        TEST(frames_leave_thirty_times_per_second_of_the_run),
        TEST(a_slow_page_loses_frames_and_holds_nobody_up),
        TEST(what_a_page_should_not_send_is_counted_and_ignored),
        TEST(garbage_on_the_wire_does_not_disturb_others),
        TEST(a_foreign_page_is_refused),
        TEST(files_are_served_to_the_own_host_only),
        TEST(only_the_loopback_address_listens),
        TEST(a_port_in_use_is_named),
        TEST(the_hand_follows_a_page_within_reach_and_is_let_go_when_it_leaves),
        TEST(numbers_that_are_not_finite_and_foreign_contacts_are_left_out),
        TEST(each_instrument_has_its_own_force_and_hand),
        TEST(points_that_the_jaws_hold_are_shown_where_the_tissue_is),
        TEST(more_connections_than_allowed_are_closed),
    };
    return cmocka_run_group_tests_name("view", tests, NULL, NULL);
}
