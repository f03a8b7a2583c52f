/* What legacy VTK files and VTK XML files share: scalar types, arrays of numbers, kinds of cells, and which cell array is the
 * label. Arrays are held as doubles; node indices and offsets up to 2^53 are exact in them. */
#ifndef TROCAR_VTK_VALUES_H
#define TROCAR_VTK_VALUES_H

#include "mesh_build.h"
#include "triangle_soup.h"

enum vtk_type { VTK_NONE, VTK_I8, VTK_U8, VTK_I16, VTK_U16, VTK_I32, VTK_U32, VTK_I64, VTK_U64, VTK_F32, VTK_F64 };

size_t vtk_size(enum vtk_type type);
/* "unsigned_int", "float", ... (legacy) or "UInt32", "Float32", ... (XML); VTK_NONE if neither. */
enum vtk_type vtk_type_of(const char *name);
double vtk_value(const void *bytes, enum vtk_type type, bool swap);

/* `count` numbers as text. Where `finite`, NaN and infinity are errors. malloc. */
int vtk_text(struct scan *s, size_t count, bool finite, double **values);

/* The best array so far to label cells with. Owns `values`. */
struct vtk_label {
    int rank;
    double *values;
};

/* Offer a one-component cell array of `count`; takes `values` or frees it. An array called material, label, region and the
 * like wins over one that only holds few whole numbers; fractions are no labels. */
void vtk_offer_label(struct vtk_label *best, const char *name, double *values, size_t count);

struct vtk_cells {
    size_t count;
    const double *connectivity, *end, *type; /* end[i]: behind the last node of cell i in `connectivity` */
    size_t connectivity_count;
    size_t first_node, node_count; /* of this piece, in the mesh */
    const double *label;           /* or NULL */
    size_t first_cell;             /* for the numbers in errors */
};

int vtk_add_cells(struct scan *s, struct build *b, const struct vtk_cells *cells);

struct vtk_polygons {
    const double *points;
    size_t node_count, count;
    const double *connectivity, *end;
    size_t connectivity_count;
};

int vtk_add_polygons(struct scan *s, struct soup *soup, const struct vtk_polygons *p);

#endif
