/* Small meshes and files for the tests of host/mesh. */
#ifndef TROCAR_TESTS_MESH_FIXTURE_H
#define TROCAR_TESTS_MESH_FIXTURE_H

#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <setjmp.h>
#include <unistd.h>

#include <cmocka.h>

#include "mesh.h"
#include "progress.h"

/* Bytes that grow. */
struct bytes {
    unsigned char *data;
    size_t length, room;
};

static inline void put(struct bytes *b, const void *data, size_t length)
{
    if (b->length + length + 1 > b->room) {
        b->room = 2 * (b->length + length + 1);
        b->data = realloc(b->data, b->room);
        assert_non_null(b->data);
    }
    memcpy(b->data + b->length, data, length);
    b->length += length;
    b->data[b->length] = 0;
}

__attribute__((format(printf, 2, 3))) static inline void put_text(struct bytes *b, const char *format, ...)
{
    char line[1024];
    va_list arguments;
    va_start(arguments, format);
    int n = vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    assert_in_range(n, 0, sizeof line - 1);
    put(b, line, (size_t)n);
}

/* A number of `size` bytes in this machine's order, or reversed. */
static inline void put_number(struct bytes *b, const void *number, size_t size, bool reversed)
{
    unsigned char copy[8];
    for (size_t i = 0; i < size; i++)
        copy[i] = ((const unsigned char *)number)[reversed ? size - 1 - i : i];
    put(b, copy, size);
}

static inline void put_i32(struct bytes *b, int32_t value, bool reversed)
{
    put_number(b, &value, 4, reversed);
}

static inline void put_u64(struct bytes *b, uint64_t value, bool reversed)
{
    put_number(b, &value, 8, reversed);
}

static inline void put_f32(struct bytes *b, float value, bool reversed)
{
    put_number(b, &value, 4, reversed);
}

static inline void put_f64(struct bytes *b, double value, bool reversed)
{
    put_number(b, &value, 8, reversed);
}

/* A file of this test in $TMPDIR; the name ends with `name`. */
static inline const char *temporary_path(const char *name)
{
    static char path[512];
    const char *directory = getenv("TMPDIR");
    snprintf(path, sizeof path, "%s/trocar-test-%ld-%s", directory && *directory ? directory : "/tmp", (long)getpid(),
             name);
    return path;
}

static inline int read_bytes(const char *name, const void *data, size_t length, double size, struct mesh *mesh,
                             struct failure *why)
{
    const char *path = temporary_path(name);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, length, file), length);
    assert_int_equal(fclose(file), 0);
    memset(why, 0, sizeof *why);
    int status = mesh_read(path, size, mesh, why);
    unlink(path);
    return status;
}

static inline int read_text(const char *name, const char *text, struct mesh *mesh, struct failure *why)
{
    return read_bytes(name, text, strlen(text), 0, mesh, why);
}

/* A box of n x n x n cubes of side 1, each in six tetrahedra around its diagonal (Kuhn); labels 1 (x < n/2) and 2. */
static inline struct mesh box_mesh(int n)
{
    static const int step[6][2] = {{0, 1}, {0, 2}, {1, 0}, {1, 2}, {2, 0}, {2, 1}};
    int m = n + 1;
    struct mesh mesh = {.node_count = (size_t)(m * m * m), .tetrahedron_count = (size_t)(6 * n * n * n)};
    mesh.nodes = malloc(mesh.node_count * 3 * sizeof *mesh.nodes);
    mesh.tetrahedra = malloc(mesh.tetrahedron_count * 4 * sizeof *mesh.tetrahedra);
    mesh.labels = malloc(mesh.tetrahedron_count * sizeof *mesh.labels);
    mesh.label = calloc(2, sizeof *mesh.label);
    mesh.label_count = 2;
    mesh.label[0] = (struct mesh_label){1, "left"};
    mesh.label[1] = (struct mesh_label){2, "right"};
    snprintf(mesh.path, sizeof mesh.path, "box");
    for (int i = 0; i < m * m * m; i++)
        for (int k = 0, rest = i; k < 3; k++, rest /= m)
            mesh.nodes[3 * i + k] = rest % m;
    size_t e = 0;
    for (int c = 0; c < n * n * n; c++)
        for (int s = 0; s < 6; s++, e++) {
            int at[3] = {c % n, c / n % n, c / n / n};
            uint32_t *corner = mesh.tetrahedra + 4 * e;
            for (int k = 0; k < 4; k++) {
                corner[k] = (uint32_t)(at[0] + m * (at[1] + m * at[2]));
                if (k < 2)
                    at[step[s][k]]++;
                else if (k == 2)
                    at[3 - step[s][0] - step[s][1]]++;
            }
            mesh.labels[e] = c % n < n / 2 ? 1 : 2;
        }
    return mesh;
}

/* Nodes and elements given as tables. */
static inline struct mesh mesh_of(const double *nodes, size_t node_count, const uint32_t *tetrahedra, size_t count)
{
    struct mesh mesh = {.node_count = node_count, .tetrahedron_count = count, .path = "table"};
    mesh.nodes = malloc(node_count * 3 * sizeof *nodes);
    mesh.tetrahedra = malloc(count * 4 * sizeof *tetrahedra);
    mesh.labels = calloc(count, sizeof *mesh.labels);
    memcpy(mesh.nodes, nodes, node_count * 3 * sizeof *nodes);
    memcpy(mesh.tetrahedra, tetrahedra, count * 4 * sizeof *tetrahedra);
    return mesh;
}

/* A path in the folder of third-party meshes, or NULL (say so) if the folder is not there. */
static inline const char *data_path(const char *name)
{
    static char path[512];
    const char *folder = getenv("TROCAR_DATA");
    snprintf(path, sizeof path, "%s/%s", folder && *folder ? folder : "../shared/data", name);
    if (access(path, R_OK) != 0)
        return NULL;
    return path;
}

#endif
