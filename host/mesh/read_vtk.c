/* Legacy VTK. https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html, and its version 5 (OFFSETS and
 * CONNECTIVITY). Binary numbers are big-endian. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh_data.h"
#include "mesh_readers.h"
#include "vtk_values.h"

struct vtk {
    struct scan *s;
    struct mesh *mesh;
    bool binary;
    size_t node_count, cell_count, connectivity_count, type_count;
    double *points, *connectivity, *end, *type;
    bool have_cells;
    size_t data_count; /* of the section CELL_DATA or POINT_DATA */
    bool of_cells;
    struct vtk_label label;
};

/* An array that follows its keyword's line. */
static int read_array(struct vtk *v, const char *type_name, uint64_t count, bool finite, double **values)
{
    struct scan *s = v->s;
    enum vtk_type type = vtk_type_of(type_name);
    size_t size = vtk_size(type);
    *values = NULL;
    if (type == VTK_NONE)
        return scan_fail(s, STATUS_MESH_SYNTAX, "\"%.30s\" is not a type of number that is known", type_name);
    if (!v->binary) {
        int status = scan_fits(s, count, 2, "numbers");
        return status ? status : vtk_text(s, (size_t)count, finite, values);
    }
    scan_next_line(s);
    s->binary = true;
    if (count > (s->length - s->at) / size)
        return scan_fail(s, STATUS_MESH_SYNTAX, "the file announces %llu numbers, but only %zu bytes follow",
                         (unsigned long long)count, s->length - s->at);
    *values = malloc((count ? (size_t)count : 1) * sizeof **values);
    if (!*values)
        return scan_fail(s, STATUS_MEMORY, "no memory for %llu numbers", (unsigned long long)count);
    for (size_t i = 0; i < count; i++, s->at += size) {
        (*values)[i] = vtk_value(s->bytes + s->at, type, __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__);
        if (finite && !isfinite((*values)[i])) {
            free(*values);
            *values = NULL;
            return scan_fail(s, STATUS_MESH_NONFINITE, "a coordinate is not finite");
        }
    }
    return STATUS_OK;
}

static int read_points(struct vtk *v)
{
    char type[32];
    int status = scan_count(v->s, 3, &v->node_count, "points");
    if (status == STATUS_OK)
        status = scan_word(v->s, type, sizeof type, "the type of the coordinates");
    return status ? status : read_array(v, type, 3 * (uint64_t)v->node_count, true, &v->points);
}

/* The old form: per cell its number of nodes, then the nodes; turned into ends and connectivity in place. */
static int split_cells(struct vtk *v, size_t size)
{
    double *list = v->connectivity;
    size_t from = 0, to = 0;
    for (size_t i = 0; i < v->cell_count; i++) {
        double n = from < size ? list[from++] : -1;
        if (!(n >= 0 && n <= (double)(size - from) && n == floor(n)))
            return scan_fail(v->s, STATUS_MESH_SYNTAX, "cell %zu does not fit the list of %zu numbers", i, size);
        memmove(list + to, list + from, (size_t)n * sizeof *list);
        from += (size_t)n;
        to += (size_t)n;
        v->end[i] = (double)to;
    }
    if (from != size)
        return scan_fail(v->s, STATUS_MESH_SYNTAX, "the cells use %zu of the %zu numbers announced", from, size);
    v->connectivity_count = to;
    return STATUS_OK;
}

/* "CELLS n size" or "POLYGONS n size", in either form. */
static int read_cells(struct vtk *v)
{
    struct scan *s = v->s;
    size_t first, second;
    char type[32];
    if (v->have_cells)
        return scan_fail(s, STATUS_MESH_SYNTAX, "the cells stand there twice");
    v->have_cells = true;
    int status = scan_count(s, 1, &first, "cells");
    if (status == STATUS_OK)
        status = scan_count(s, 1, &second, "numbers");
    if (status)
        return status;
    if (!scan_more_on_line(s) && !v->binary) /* which form it is, the next word tells */
        scan_skip(s);
    struct scan ahead = *s;
    if (v->binary)
        scan_next_line(&ahead);
    if (!scan_accept(&ahead, "OFFSETS")) {
        v->cell_count = first;
        v->end = calloc(first ? first : 1, sizeof *v->end);
        if (!v->end)
            return scan_fail(s, STATUS_MEMORY, "no memory for %zu cells", first);
        status = read_array(v, "int", second, true, &v->connectivity);
        return status ? status : split_cells(v, second);
    }
    *s = ahead;
    status = scan_word(s, type, sizeof type, "the type of the offsets");
    if (status == STATUS_OK)
        status = read_array(v, type, first, true, &v->end);
    if (status == STATUS_OK && !scan_accept(s, "CONNECTIVITY"))
        status = scan_fail(s, STATUS_MESH_SYNTAX, "CONNECTIVITY should follow the offsets");
    if (status == STATUS_OK)
        status = scan_word(s, type, sizeof type, "the type of the connectivity");
    if (status == STATUS_OK)
        status = read_array(v, type, second, true, &v->connectivity);
    if (status)
        return status;
    if (first == 0 || v->end[0] != 0)
        return scan_fail(s, STATUS_MESH_SYNTAX, "the offsets do not begin with 0");
    v->cell_count = first - 1; /* offsets are one more than cells; keep where each ends */
    memmove(v->end, v->end + 1, v->cell_count * sizeof *v->end);
    v->connectivity_count = second;
    return STATUS_OK;
}

/* Take or free the values of an array of `count` tuples. */
static int keep(struct vtk *v, const char *name, size_t components, double *values, size_t count)
{
    struct mesh_data *data = v->of_cells ? NULL : mesh_data_wanted(v->mesh, name);
    bool good = !data || data->value || count != v->node_count || mesh_data_append(data, components, values, count);
    if (components == 1 && v->of_cells && count == v->data_count)
        vtk_offer_label(&v->label, name, values, count);
    else
        free(values);
    return good ? STATUS_OK : scan_fail(v->s, STATUS_MEMORY, "no memory for the data of %zu nodes", count);
}

static int read_scalars(struct vtk *v)
{
    struct scan *s = v->s;
    char name[80], type[32], table[80];
    int64_t components = 1;
    double *values;
    int status = scan_word(s, name, sizeof name, "the name of the scalars");
    if (status == STATUS_OK)
        status = scan_word(s, type, sizeof type, "the type of the scalars");
    if (status == STATUS_OK && scan_more_on_line(s))
        status = scan_integer(s, 1, 4, &components, "the number of components");
    if (status == STATUS_OK && scan_accept(s, "LOOKUP_TABLE"))
        status = scan_word(s, table, sizeof table, "the name of the table");
    if (status == STATUS_OK)
        status = read_array(v, type, v->data_count * (uint64_t)components, false, &values);
    if (status)
        return status;
    return keep(v, name, (size_t)components, values, v->data_count);
}

static int read_field(struct vtk *v)
{
    struct scan *s = v->s;
    char name[80], type[32];
    size_t arrays;
    int status = scan_word(s, name, sizeof name, "the name of the field");
    if (status == STATUS_OK)
        status = scan_count(s, 8, &arrays, "arrays");
    for (size_t i = 0; status == STATUS_OK && i < arrays; i++) {
        int64_t components, count;
        double *values;
        status = scan_word(s, name, sizeof name, "the name of an array");
        if (status == STATUS_OK)
            status = scan_integer(s, 0, 1000, &components, "the number of components");
        if (status == STATUS_OK)
            status = scan_integer(s, 0, UINT32_MAX, &count, "the number of tuples");
        if (status == STATUS_OK)
            status = scan_word(s, type, sizeof type, "the type of an array");
        if (status == STATUS_OK)
            status = read_array(v, type, (uint64_t)components * (uint64_t)count, false, &values);
        if (status == STATUS_OK)
            status = keep(v, name, (size_t)components, values, (size_t)count);
    }
    return status;
}

/* Arrays that carry no label: name, type, then `components` numbers each. */
static int read_data(struct vtk *v, size_t components)
{
    char name[80], type[32];
    double *values;
    int status = scan_word(v->s, name, sizeof name, "the name of the data");
    if (status == STATUS_OK)
        status = scan_word(v->s, type, sizeof type, "the type of the data");
    if (status == STATUS_OK)
        status = read_array(v, type, v->data_count * (uint64_t)components, false, &values);
    return status ? status : keep(v, name, components, values, v->of_cells ? 0 : v->data_count);
}

static int read_keyword(struct vtk *v, const char *word, bool surface, bool *known)
{
    struct scan *s = v->s;
    *known = true;
    if (strcmp(word, "POINTS") == 0 && !v->points)
        return read_points(v);
    if (strcmp(word, surface ? "POLYGONS" : "CELLS") == 0)
        return read_cells(v);
    if (strcmp(word, "CELL_TYPES") == 0 && !v->type) {
        int status = scan_count(s, 1, &v->type_count, "cell types");
        return status ? status : read_array(v, "int", v->type_count, true, &v->type);
    }
    if (strcmp(word, "CELL_DATA") == 0 || strcmp(word, "POINT_DATA") == 0) {
        v->of_cells = word[0] == 'C';
        int status = scan_count(s, 1, &v->data_count, "data");
        size_t wanted = v->of_cells ? v->cell_count : v->node_count;
        if (status == STATUS_OK && v->data_count != wanted && !surface)
            return scan_fail(s, STATUS_MESH_SYNTAX, "%s for %zu where there are %zu", word, v->data_count, wanted);
        return status;
    }
    if (strcmp(word, "SCALARS") == 0)
        return read_scalars(v);
    if (strcmp(word, "FIELD") == 0)
        return read_field(v);
    if (strcmp(word, "VECTORS") == 0 || strcmp(word, "NORMALS") == 0)
        return read_data(v, 3);
    if (strcmp(word, "TENSORS") == 0)
        return read_data(v, 9);
    if (strcmp(word, "GLOBAL_IDS") == 0 || strcmp(word, "PEDIGREE_IDS") == 0)
        return read_data(v, 1);
    if (strcmp(word, "METADATA") == 0) { /* lines up to an empty one */
        scan_next_line(s);
        while (scan_more_on_line(s))
            scan_next_line(s);
        return STATUS_OK;
    }
    *known = false;
    return STATUS_OK;
}

/* The three lines of the head, then DATASET. */
static int read_head(struct vtk *v, char dataset[32])
{
    struct scan *s = v->s;
    char word[32];
    scan_next_line(s);
    scan_next_line(s);
    int status = scan_word(s, word, sizeof word, "ASCII or BINARY");
    if (status == STATUS_OK && strcmp(word, "ASCII") != 0 && strcmp(word, "BINARY") != 0)
        status = scan_fail(s, STATUS_MESH_SYNTAX, "\"%.20s\" stands where ASCII or BINARY should", word);
    v->binary = status == STATUS_OK && word[0] == 'B';
    if (status == STATUS_OK && !scan_accept(s, "DATASET"))
        status = scan_fail(s, STATUS_MESH_SYNTAX, "DATASET should follow the head");
    return status ? status : scan_word(s, dataset, 32, "the kind of data set");
}

static int read_all(struct vtk *v, bool surface, char *warning, size_t room)
{
    struct scan *s = v->s;
    int status = STATUS_OK;
    while (status == STATUS_OK && scan_skip(s)) {
        char word[32];
        bool known;
        s->binary = v->binary;
        status = scan_word(s, word, sizeof word, "a keyword");
        if (status == STATUS_OK)
            status = read_keyword(v, word, surface, &known);
        if (status == STATUS_OK && !known) {
            if (!v->points || !v->have_cells || (!surface && !v->type))
                return scan_fail(s, STATUS_MESH_SYNTAX, "the keyword \"%.30s\" is not known here", word);
            snprintf(warning, room, "data from the keyword %.30s on were not read", word);
            break;
        }
    }
    if (status == STATUS_OK && (!v->points || !v->have_cells || (!surface && !v->type)))
        status = scan_fail(s, STATUS_MESH_SYNTAX, "the file ends before %s",
                           !v->points       ? "its points"
                           : !v->have_cells ? "its cells"
                                            : "its cell types");
    if (status == STATUS_OK && !surface && v->type_count != v->cell_count)
        status = scan_fail(s, STATUS_MESH_SYNTAX, "%zu cell types for %zu cells", v->type_count, v->cell_count);
    return status;
}

static void vtk_release(struct vtk *v)
{
    free(v->points);
    free(v->connectivity);
    free(v->end);
    free(v->type);
    free(v->label.values);
}

int read_vtk(struct scan *s, struct mesh *mesh, struct soup *soup, bool *is_surface)
{
    struct vtk v = {.s = s, .mesh = mesh};
    struct build build = {.mesh = mesh};
    char dataset[32] = "";
    int status = read_head(&v, dataset);
    *is_surface = strcmp(dataset, "POLYDATA") == 0;
    if (status == STATUS_OK && !*is_surface && strcmp(dataset, "UNSTRUCTURED_GRID") != 0)
        status = scan_fail_remedy(s, STATUS_MESH_FORMAT, "export an unstructured grid",
                                  "the data set is %.30s, not UNSTRUCTURED_GRID", dataset);
    if (status == STATUS_OK)
        status = read_all(&v, *is_surface, mesh->warning, sizeof mesh->warning);
    if (status == STATUS_OK && *is_surface) {
        struct vtk_polygons p = {v.points, v.node_count, v.cell_count, v.connectivity, v.end, v.connectivity_count};
        status = vtk_add_polygons(s, soup, &p);
    } else if (status == STATUS_OK) {
        status = build_nodes(&build, s, v.node_count);
        if (status == STATUS_OK)
            memcpy(mesh->nodes, v.points, 3 * v.node_count * sizeof *v.points);
        struct vtk_cells cells = {.count = v.cell_count,
                                  .connectivity = v.connectivity,
                                  .end = v.end,
                                  .type = v.type,
                                  .connectivity_count = v.connectivity_count,
                                  .node_count = v.node_count,
                                  .label = v.label.values};
        if (status == STATUS_OK)
            status = vtk_add_cells(s, &build, &cells);
        if (status == STATUS_OK)
            status = build_finish(&build, s);
    }
    build_free(&build);
    vtk_release(&v);
    return status;
}
