/* The monitor's three forms: line, table, JSON. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "decode.h"
#include "monitor.h"
#include "safety.h"

enum { SILENT_US = 500000 }; /* five heartbeats */

static const char *state_name(unsigned state)
{
    static const char *const names[] = {"INIT", "READY", "RUN", "SAFE"};
    return state <= SAFETY_SAFE ? names[state] : "?";
}

static double elapsed_s(const struct monitor *monitor)
{
    return 1e-6 * (double)(monitor->now_us - monitor->first_us);
}

static double force_N(const struct link *link)
{
    return sqrt(link->force_N[0] * link->force_N[0] + link->force_N[1] * link->force_N[1] +
                link->force_N[2] * link->force_N[2]);
}

/* "node 1 RUN, 1.234 N, 3 contacts", the reason of SAFE, then every counter of Health that is not 0. */
static void print_node(FILE *out, const struct link *link, uint64_t now_us)
{
    uint64_t heard_us = link->heartbeat_time_us > link->pose_time_us ? link->heartbeat_time_us : link->pose_time_us;
    fprintf(out, "node %u %s", link->node_id, state_name(link->state));
    if (now_us > heard_us + SILENT_US)
        fprintf(out, ", silent for %.1f s", 1e-6 * (double)(now_us - heard_us));
    if (link->reason)
        fprintf(out, " (%s)", status_name(link->reason));
    fprintf(out, ", %.3f N, %zu contact%s", force_N(link), link->contact_count, link->contact_count == 1 ? "" : "s");
    for (unsigned i = 0; link_health_name(i); i++)
        if (link->health[i] && strcmp(link_health_name(i), "state_hash") != 0 &&
            strcmp(link_health_name(i), "hash_tick") != 0)
            fprintf(out, ", %s %u", link_health_name(i), link->health[i]);
    if (link->malformed + link->incomplete_sets)
        fprintf(out, "; %llu frames malformed, %llu sets incomplete", (unsigned long long)link->malformed,
                (unsigned long long)link->incomplete_sets);
}

static void print_mirror(FILE *out, const struct monitor *monitor)
{
    if (!monitor->mirror || monitor->mirror->ticks == 0)
        return;
    if (monitor->differed)
        fprintf(out, "%llu torque frames differ from the bank's", (unsigned long long)monitor->differed);
    else
        fprintf(out, "torques agree with the bank's");
}

void monitor_line(FILE *out, const struct monitor *monitor)
{
    fprintf(out, "%9.3f s  load %5.1f %%  %6.0f frames/s", elapsed_s(monitor), 100 * monitor->load,
            monitor->per_second);
    if (monitor->errors)
        fprintf(out, "  %llu error frames", (unsigned long long)monitor->errors);
    for (size_t i = 0; i < monitor->node_count; i++) {
        fputs("  ", out);
        print_node(out, &monitor->link[i], monitor->now_us);
    }
    if (monitor->mirror && monitor->mirror->ticks) {
        fputs("  ", out);
        print_mirror(out, monitor);
    }
    fputc('\n', out);
    fflush(out);
}

/* One row, cut at `columns`, with the rest of the terminal's line cleared. */
static void print_row(FILE *out, unsigned columns, const char *text)
{
    fprintf(out, "%.*s\033[K\n", (int)columns, text);
}

void monitor_table(FILE *out, const struct monitor *monitor, unsigned columns)
{
    char text[DECODE_TEXT + 200], decoded[DECODE_TEXT], data[129];
    fputs("\033[H", out);
    snprintf(text, sizeof text, "%.1f s, load %.1f %%, %.0f frames/s, %llu frames, %llu error frames; Ctrl-C ends it",
             elapsed_s(monitor), 100 * monitor->load, monitor->per_second, (unsigned long long)monitor->frames,
             (unsigned long long)monitor->errors);
    print_row(out, columns, text);
    for (size_t i = 0; i < monitor->node_count; i++) {
        char *line = NULL;
        size_t length = 0;
        FILE *memory = open_memstream(&line, &length);
        if (memory) {
            print_node(memory, &monitor->link[i], monitor->now_us);
            fclose(memory);
            print_row(out, columns, line);
            free(line);
        }
    }
    if (monitor->mirror && monitor->mirror->ticks)
        print_row(out, columns,
                  monitor->differed ? "torques differ from those of the bank" : "torques agree with those of the bank");
    print_row(out, columns, "");
    print_row(out, columns, "   id      per s      count  data              meaning");
    for (size_t i = 0; i < monitor->id_count; i++) {
        const struct monitor_id *id = &monitor->id[i];
        decode_text(monitor->dbc, &id->last, decoded);
        snprintf(text, sizeof text, "%5X %10.1f %10llu  %-16s  %s", id->id & 0x7fffffff, id->per_second,
                 (unsigned long long)id->count, decode_data(&id->last, data), decoded);
        print_row(out, columns, text);
    }
    fputs("\033[J", out);
    fflush(out);
}

static void add(struct json_object *object, const char *key, uint64_t value)
{
    json_object_object_add(object, key, json_object_new_int64((int64_t)value));
}

static struct json_object *node_json(const struct link *link)
{
    struct json_object *node = json_object_new_object(), *health = json_object_new_object();
    add(node, "node", link->node_id);
    json_object_object_add(node, "state", json_object_new_string(state_name(link->state)));
    json_object_object_add(node, "reason", json_object_new_string(link->reason ? status_name(link->reason) : ""));
    json_object_object_add(node, "force_N", json_object_new_double(force_N(link)));
    add(node, "contacts", link->contact_count);
    add(node, "contact_sets", link->contact_sets);
    add(node, "malformed", link->malformed);
    add(node, "late", link->late);
    add(node, "incomplete_sets", link->incomplete_sets);
    for (unsigned i = 0; link_health_name(i); i++)
        add(health, link_health_name(i), link->health[i]);
    json_object_object_add(node, "health", health);
    return node;
}

struct json_object *monitor_json(const struct monitor *monitor)
{
    struct json_object *root = json_object_new_object(), *ids = json_object_new_array();
    struct json_object *nodes = json_object_new_array();
    unsigned of;
    json_object_object_add(root, "time_s", json_object_new_double(elapsed_s(monitor)));
    add(root, "frames", monitor->frames);
    add(root, "error_frames", monitor->errors);
    json_object_object_add(root, "load", json_object_new_double(monitor->load));
    json_object_object_add(root, "per_second", json_object_new_double(monitor->per_second));
    for (size_t i = 0; i < monitor->id_count; i++) {
        const struct monitor_id *id = &monitor->id[i];
        const struct dbc_message *m = id->last.flags ? NULL : dbc_find(monitor->dbc, id->id, &of);
        struct json_object *entry = json_object_new_object();
        add(entry, "id", id->id & 0x7fffffff);
        json_object_object_add(entry, "name", m ? json_object_new_string(m->name) : NULL);
        add(entry, "count", id->count);
        json_object_object_add(entry, "per_second", json_object_new_double(id->per_second));
        json_object_array_add(ids, entry);
    }
    json_object_object_add(root, "ids", ids);
    for (size_t i = 0; i < monitor->node_count; i++)
        json_object_array_add(nodes, node_json(&monitor->link[i]));
    json_object_object_add(root, "nodes", nodes);
    if (monitor->mirror) {
        struct json_object *mirror = json_object_new_object();
        add(mirror, "ticks", monitor->mirror->ticks);
        add(mirror, "agreed", monitor->mirror->agreed);
        add(mirror, "differed", monitor->mirror->differed);
        add(mirror, "hashes_agreed", monitor->mirror->hashes_agreed);
        add(mirror, "hashes_differed", monitor->mirror->hashes_differed);
        json_object_object_add(root, "mirror", mirror);
    }
    return root;
}
