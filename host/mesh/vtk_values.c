#include "vtk_values.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const struct {
    const char *legacy, *xml;
    enum vtk_type type;
    size_t size;
} types[] = {
    {"char", "Int8", VTK_I8, 1},      {"unsigned_char", "UInt8", VTK_U8, 1},
    {"short", "Int16", VTK_I16, 2},   {"unsigned_short", "UInt16", VTK_U16, 2},
    {"int", "Int32", VTK_I32, 4},     {"unsigned_int", "UInt32", VTK_U32, 4},
    {"long", "Int64", VTK_I64, 8},    {"unsigned_long", "UInt64", VTK_U64, 8},
    {"vtktypeint64", "", VTK_I64, 8}, {"vtktypeuint64", "", VTK_U64, 8},
    {"float", "Float32", VTK_F32, 4}, {"double", "Float64", VTK_F64, 8},
    {"vtkidtype", "", VTK_I32, 4},    {"signed_char", "", VTK_I8, 1},
};

size_t vtk_size(enum vtk_type type)
{
    for (size_t i = 0; i < sizeof types / sizeof types[0]; i++)
        if (types[i].type == type)
            return types[i].size;
    return 0;
}

enum vtk_type vtk_type_of(const char *name)
{
    for (size_t i = 0; i < sizeof types / sizeof types[0]; i++)
        if (strcasecmp(types[i].legacy, name) == 0 || (*types[i].xml && strcmp(types[i].xml, name) == 0))
            return types[i].type;
    return VTK_NONE;
}

double vtk_value(const void *bytes, enum vtk_type type, bool swap)
{
    union {
        int8_t i8;
        uint8_t u8;
        int16_t i16;
        uint16_t u16;
        int32_t i32;
        uint32_t u32;
        int64_t i64;
        uint64_t u64;
        float f32;
        double f64;
    } x = {0};
    size_t size = vtk_size(type);
    memcpy(&x, bytes, size);
    if (swap)
        swap_bytes(&x, size);
    switch (type) {
    case VTK_I8:
        return x.i8;
    case VTK_U8:
        return x.u8;
    case VTK_I16:
        return x.i16;
    case VTK_U16:
        return x.u16;
    case VTK_I32:
        return x.i32;
    case VTK_U32:
        return x.u32;
    case VTK_I64:
        return (double)x.i64;
    case VTK_U64:
        return (double)x.u64;
    case VTK_F32:
        return (double)x.f32;
    case VTK_F64:
        return x.f64;
    default:
        return NAN;
    }
}

int vtk_text(struct scan *s, size_t count, bool finite, double **values)
{
    *values = malloc((count ? count : 1) * sizeof **values);
    if (!*values)
        return scan_fail(s, STATUS_MEMORY, "no memory for %zu numbers", count);
    int status = STATUS_OK;
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        if (finite) {
            status = scan_double(s, *values + i, "a number");
            continue;
        }
        const char *token;
        size_t n = scan_peek(s, &token);
        if (n == 0)
            status = scan_fail(s, STATUS_MESH_SYNTAX, "the array ends after %zu of %zu numbers", i, count);
        (*values)[i] = n ? strtod(token, NULL) : 0;
        s->at += n;
    }
    if (status) {
        free(*values);
        *values = NULL;
    }
    return status;
}

static bool is_label_name(const char *name)
{
    static const char *const known[] = {"material", "label",        "region",         "physical",  "tissue", "segment",
                                        "domain",   "cellentityid", "elementblockid", "subdomain", "part",   "group"};
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
        if (strcasestr(name, known[i]))
            return true;
    return false;
}

void vtk_offer_label(struct vtk_label *best, const char *name, double *values, size_t count)
{
    double low = INFINITY, high = -INFINITY;
    bool whole = count > 0;
    for (size_t i = 0; i < count && whole; i++) {
        whole = values[i] == floor(values[i]) && fabs(values[i]) <= INT32_MAX;
        low = fmin(low, values[i]);
        high = fmax(high, values[i]);
    }
    /* an unnamed array of many different numbers is an index, not a label */
    int rank = !whole ? 0 : is_label_name(name) ? 2 : high - low < 256;
    if (rank > best->rank) {
        free(best->values);
        *best = (struct vtk_label){rank, values};
    } else {
        free(values);
    }
}

/* https://vtk.org/doc/nightly/html/vtkCellType_8h.html */
static struct cell_kind kind_of(double type)
{
    static const char *const refused[] = {[11] = "voxel",   [12] = "hexahedron",       [13] = "wedge",
                                          [14] = "pyramid", [15] = "pentagonal prism", [16] = "hexagonal prism"};
    if (type == 10 || type == 24 || type == 71 || type == 78) /* linear, quadratic, Lagrange, Bezier */
        return (struct cell_kind){CELL_TETRAHEDRON, 0, "tetrahedron"};
    if ((type >= 0 && type <= 9) || (type >= 21 && type <= 23) || type == 28 || type == 30 ||
        (type >= 34 && type <= 36) || (type >= 68 && type <= 70) || (type >= 75 && type <= 77))
        return (struct cell_kind){CELL_IGNORED, 0, "surface"};
    if (type >= 11 && type <= 16)
        return (struct cell_kind){CELL_REFUSED, 0, refused[(int)type]};
    if (type > 0 && type < 82)
        return (struct cell_kind){CELL_REFUSED, 0, "volume cell that is not a tetrahedron"};
    return (struct cell_kind){CELL_UNKNOWN, 0, ""};
}

int vtk_add_cells(struct scan *s, struct build *b, const struct vtk_cells *cells)
{
    for (size_t i = 0; i < cells->count; i++) {
        double start = i ? cells->end[i - 1] : 0, end = cells->end[i];
        size_t number = cells->first_cell + i;
        if (!(end >= start && end <= (double)cells->connectivity_count && end == floor(end)))
            return scan_fail(s, STATUS_MESH_INDEX, "cell %zu ends at %g of %zu node numbers", number, end,
                             cells->connectivity_count);
        struct cell_kind kind = kind_of(cells->type[i]);
        if (kind.use == CELL_UNKNOWN)
            return scan_fail(s, STATUS_MESH_FORMAT, "cell %zu has type %g, which is not known", number, cells->type[i]);
        if (kind.use == CELL_REFUSED)
            return build_refuse(s, (int64_t)number, &kind);
        if (kind.use == CELL_IGNORED) {
            b->mesh->ignored_elements++;
            continue;
        }
        if (end - start < 4)
            return scan_fail(s, STATUS_MESH_SYNTAX, "cell %zu is a tetrahedron with %g nodes", number, end - start);
        uint32_t corner[4];
        for (int k = 0; k < 4; k++) {
            double node = cells->connectivity[(size_t)start + (size_t)k];
            if (!(node >= 0 && node < (double)cells->node_count && node == floor(node)))
                return scan_fail(s, STATUS_MESH_INDEX, "cell %zu names node %.17g of %zu (counted from 0)", number,
                                 node, cells->node_count);
            corner[k] = (uint32_t)(cells->first_node + (size_t)node);
        }
        int status = build_tetrahedron(b, s, corner, cells->label ? (int32_t)cells->label[i] : 0);
        if (status)
            return status;
    }
    return STATUS_OK;
}

int vtk_add_polygons(struct scan *s, struct soup *soup, const struct vtk_polygons *p)
{
    size_t first = soup->vertex_count;
    int status = STATUS_OK;
    for (size_t i = 0; i < p->node_count && status == STATUS_OK; i++)
        status = soup_vertex(soup, s, p->points + 3 * i);
    for (size_t i = 0; i < p->count && status == STATUS_OK; i++) {
        double start = i ? p->end[i - 1] : 0, end = p->end[i];
        uint32_t corner[SOUP_POLYGON];
        if (!(end - start >= 3 && end - start <= SOUP_POLYGON && end <= (double)p->connectivity_count &&
              end == floor(end)))
            return scan_fail(s, STATUS_MESH_SYNTAX, "polygon %zu has %g corners", i, end - start);
        size_t corners = (size_t)(end - start);
        for (size_t k = 0; k < corners; k++) {
            double node = p->connectivity[(size_t)start + k];
            if (!(node >= 0 && node < (double)p->node_count && node == floor(node)))
                return scan_fail(s, STATUS_MESH_INDEX, "polygon %zu names point %.17g of %zu (counted from 0)", i, node,
                                 p->node_count);
            corner[k] = (uint32_t)(first + (size_t)node);
        }
        status = soup_polygon(soup, s, corner, corners);
    }
    return status;
}
