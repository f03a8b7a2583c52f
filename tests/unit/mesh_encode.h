/* Encoders of every format that host/mesh reads, written for the tests from the formats' definitions. */
#ifndef TROCAR_TESTS_MESH_ENCODE_H
#define TROCAR_TESTS_MESH_ENCODE_H

#include <zlib.h>

#include "mesh_fixture.h"

static inline void encode_gmsh1(const struct mesh *m, struct bytes *b)
{
    put_text(b, "$NOD\n%zu\n", m->node_count);
    for (size_t i = 0; i < m->node_count; i++) /* numbers with gaps */
        put_text(b, "%zu %.17g %.17g %.17g\n", 3 * i + 7, m->nodes[3 * i], m->nodes[3 * i + 1], m->nodes[3 * i + 2]);
    put_text(b, "$ENDNOD\n$ELM\n%zu\n1 2 0 0 3 7 10 13\n", m->tetrahedron_count + 1);
    for (size_t e = 0; e < m->tetrahedron_count; e++) {
        const uint32_t *t = m->tetrahedra + 4 * e;
        put_text(b, "%zu 4 %d 1 4 %u %u %u %u\n", e + 2, m->labels[e], 3 * t[0] + 7, 3 * t[1] + 7, 3 * t[2] + 7,
                 3 * t[3] + 7);
    }
    put_text(b, "$ENDELM\n");
}

static inline void put_names(const struct mesh *m, struct bytes *b)
{
    put_text(b, "$PhysicalNames\n%zu\n", m->label_count);
    for (size_t i = 0; i < m->label_count; i++)
        put_text(b, "3 %d \"%s\"\n", m->label[i].number, m->label[i].name);
    put_text(b, "$EndPhysicalNames\n");
}

static inline void encode_gmsh2(const struct mesh *m, bool binary, bool reversed, struct bytes *b)
{
    put_text(b, "$MeshFormat\n2.2 %d 8\n", binary);
    if (binary) {
        put_i32(b, 1, reversed);
        put_text(b, "\n");
    }
    put_text(b, "$EndMeshFormat\n");
    put_names(m, b);
    put_text(b, "$Nodes\n%zu\n", m->node_count);
    for (size_t i = 0; i < m->node_count; i++) {
        const double *x = m->nodes + 3 * i;
        if (binary) {
            put_i32(b, (int32_t)i + 1, reversed);
            for (int k = 0; k < 3; k++)
                put_f64(b, x[k], reversed);
        } else {
            put_text(b, "%zu %.17g %.17g %.17g\n", i + 1, x[0], x[1], x[2]);
        }
    }
    put_text(b, "\n$EndNodes\n$Elements\n%zu\n", m->tetrahedron_count + 1);
    if (binary) { /* a line first, in a block of its own */
        for (int k = 0; k < 3; k++)
            put_i32(b, k < 2 ? 1 : 2, reversed);
        for (int k = 0; k < 5; k++)
            put_i32(b, (int[]){1, 0, 0, 1, 2}[k], reversed);
        put_i32(b, 4, reversed);
        put_i32(b, (int32_t)m->tetrahedron_count, reversed);
        put_i32(b, 2, reversed);
    } else {
        put_text(b, "1 1 2 0 0 1 2\n");
    }
    for (size_t e = 0; e < m->tetrahedron_count; e++) {
        const uint32_t *t = m->tetrahedra + 4 * e;
        if (!binary) {
            put_text(b, "%zu 4 2 %d 1 %u %u %u %u\n", e + 2, m->labels[e], t[0] + 1, t[1] + 1, t[2] + 1, t[3] + 1);
            continue;
        }
        put_i32(b, (int32_t)e + 2, reversed);
        put_i32(b, m->labels[e], reversed);
        put_i32(b, 1, reversed);
        for (int k = 0; k < 4; k++)
            put_i32(b, (int32_t)t[k] + 1, reversed);
    }
    put_text(b, "%s$EndElements\n", binary ? "\n" : "");
}

/* A number in Gmsh 4: text with a blank, or binary of 4 or 8 bytes. */
struct gmsh4_out {
    struct bytes *b;
    bool binary, reversed;
};

static inline void put_int(const struct gmsh4_out *o, int32_t value)
{
    o->binary ? put_i32(o->b, value, o->reversed) : put_text(o->b, "%d ", value);
}

static inline void put_size(const struct gmsh4_out *o, uint64_t value)
{
    o->binary ? put_u64(o->b, value, o->reversed) : put_text(o->b, "%llu ", (unsigned long long)value);
}

static inline void put_double(const struct gmsh4_out *o, double value)
{
    o->binary ? put_f64(o->b, value, o->reversed) : put_text(o->b, "%.17g ", value);
}

/* Two volumes, tags 5 and 9, in the physical groups 1 and 2. */
static inline void encode_gmsh4(const struct mesh *m, bool binary, bool reversed, struct bytes *b)
{
    struct gmsh4_out o = {b, binary, reversed};
    put_text(b, "$MeshFormat\n4.1 %d 8\n", binary);
    if (binary)
        put_i32(b, 1, reversed);
    put_text(b, "%s$EndMeshFormat\n", binary ? "\n" : "");
    put_names(m, b);
    put_text(b, "$Entities\n");
    for (int k = 0; k < 4; k++)
        put_size(&o, (uint64_t[]){1, 0, 0, 2}[k]);
    put_int(&o, 3);
    for (int k = 0; k < 3; k++)
        put_double(&o, 0);
    put_size(&o, 0);
    for (int v = 0; v < 2; v++) {
        put_int(&o, v ? 5 : 9); /* not in order */
        for (int k = 0; k < 6; k++)
            put_double(&o, k);
        put_size(&o, 1);
        put_int(&o, v ? 1 : 2);
        put_size(&o, 0);
    }
    put_text(b, "\n$EndEntities\n$Nodes\n");
    size_t half = m->node_count / 2;
    put_size(&o, 2);
    put_size(&o, m->node_count);
    put_size(&o, 1);
    put_size(&o, m->node_count);
    for (int block = 0; block < 2; block++) {
        size_t from = block ? half : 0, to = block ? m->node_count : half;
        put_int(&o, block ? 3 : 2);
        put_int(&o, 5);
        put_int(&o, !block); /* parametric coordinates in the first */
        put_size(&o, to - from);
        for (size_t i = from; i < to; i++)
            put_size(&o, i + 1);
        for (size_t i = from; i < to; i++)
            for (int k = 0; k < (block ? 3 : 5); k++)
                put_double(&o, k < 3 ? m->nodes[3 * i + k] : 0.5);
    }
    put_text(b, "\n$EndNodes\n$Elements\n");
    put_size(&o, 2);
    put_size(&o, m->tetrahedron_count);
    put_size(&o, 1);
    put_size(&o, m->tetrahedron_count);
    for (int32_t label = 1; label <= 2; label++) {
        size_t count = 0;
        for (size_t e = 0; e < m->tetrahedron_count; e++)
            count += m->labels[e] == label;
        put_int(&o, 3);
        put_int(&o, label == 1 ? 5 : 9);
        put_int(&o, 4);
        put_size(&o, count);
        for (size_t e = 0; e < m->tetrahedron_count; e++) {
            if (m->labels[e] != label)
                continue;
            put_size(&o, e + 1);
            for (int k = 0; k < 4; k++)
                put_size(&o, m->tetrahedra[4 * e + k] + 1u);
        }
    }
    put_text(b, "\n$EndElements\n");
}

/* Legacy VTK; binary numbers are big-endian. `version` 2 or 5. */
static inline void encode_vtk(const struct mesh *m, bool binary, int version, struct bytes *b)
{
    size_t n = m->tetrahedron_count;
    put_text(b, "# vtk DataFile Version %d.0\ntitle\n%s\nDATASET UNSTRUCTURED_GRID\nPOINTS %zu double\n", version,
             binary ? "BINARY" : "ASCII", m->node_count);
    for (size_t i = 0; i < 3 * m->node_count; i++)
        binary ? put_f64(b, m->nodes[i], true) : put_text(b, "%.17g%c", m->nodes[i], i % 3 == 2 ? '\n' : ' ');
    if (version == 5) {
        put_text(b, "\nCELLS %zu %zu\nOFFSETS vtktypeint64\n", n + 1, 4 * n);
        for (size_t e = 0; e <= n; e++)
            binary ? put_u64(b, 4 * e, true) : put_text(b, "%zu\n", 4 * e);
        put_text(b, "\nCONNECTIVITY vtktypeint64\n");
        for (size_t i = 0; i < 4 * n; i++)
            binary ? put_u64(b, m->tetrahedra[i], true) : put_text(b, "%u\n", m->tetrahedra[i]);
    } else {
        put_text(b, "\nCELLS %zu %zu\n", n, 5 * n);
        for (size_t i = 0; i < 5 * n; i++) {
            int32_t value = i % 5 ? (int32_t)m->tetrahedra[i / 5 * 4 + i % 5 - 1] : 4;
            binary ? put_i32(b, value, true) : put_text(b, "%d\n", value);
        }
    }
    put_text(b, "\nCELL_TYPES %zu\n", n);
    for (size_t e = 0; e < n; e++)
        binary ? put_i32(b, 10, true) : put_text(b, "10\n");
    put_text(b, "\nCELL_DATA %zu\nSCALARS quality double 1\nLOOKUP_TABLE default\n", n);
    for (size_t e = 0; e < n; e++)
        binary ? put_f64(b, 0.5, true) : put_text(b, "0.5\n");
    put_text(b, "\nFIELD data 1\nmaterial 1 %zu int\n", n);
    for (size_t e = 0; e < n; e++)
        binary ? put_i32(b, m->labels[e], true) : put_text(b, "%d\n", m->labels[e]);
    put_text(b, "\n");
}

enum xml_form { XML_ASCII, XML_INLINE, XML_APPENDED_RAW, XML_APPENDED_BASE64 };

struct xml_out {
    enum xml_form form;
    bool big, wide, packed;
    struct bytes *b, appended;
};

static inline void put_base64(struct bytes *b, const unsigned char *data, size_t length)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < length; i += 3) {
        uint32_t bits = (uint32_t)data[i] << 16;
        bits |= i + 1 < length ? (uint32_t)data[i + 1] << 8 : 0;
        bits |= i + 2 < length ? data[i + 2] : 0;
        char four[4] = {digits[bits >> 18], digits[bits >> 12 & 63], i + 1 < length ? digits[bits >> 6 & 63] : '=',
                        i + 2 < length ? digits[bits & 63] : '='};
        put(b, four, 4);
    }
}

static inline void put_header(const struct xml_out *o, struct bytes *b, uint64_t value)
{
    o->wide ? put_u64(b, value, o->big) : put_i32(b, (int32_t)value, o->big);
}

/* Header and data of one array: plain as one stretch, or blocks of 1000 bytes in zlib. */
static inline void put_block(struct xml_out *o, struct bytes *to, bool base64, const struct bytes *data)
{
    struct bytes head = {0}, body = {0};
    if (o->packed) {
        size_t blocks = (data->length + 999) / 1000;
        put_header(o, &head, blocks);
        put_header(o, &head, 1000);
        put_header(o, &head, data->length % 1000);
        for (size_t i = 0; i < blocks; i++) {
            unsigned char packed[2000];
            uLongf size = sizeof packed;
            uLong left = data->length - 1000 * i;
            assert_int_equal(compress(packed, &size, data->data + 1000 * i, left < 1000 ? left : 1000), Z_OK);
            put_header(o, &head, size);
            put(&body, packed, size);
        }
    } else {
        put_header(o, &head, data->length);
        put(&body, data->data, data->length);
    }
    if (base64) {
        put_base64(to, head.data, head.length);
        put_base64(to, body.data, body.length);
    } else {
        put(to, head.data, head.length);
        put(to, body.data, body.length);
    }
    free(head.data);
    free(body.data);
}

/* An array of doubles (Float64), or of whole numbers as `type` Int32, Int64 or UInt8. */
static inline void put_array(struct xml_out *o, const char *name, const char *type, int components, const double *value,
                             size_t count)
{
    static const char *const forms[] = {"ascii", "binary", "appended", "appended"};
    struct bytes data = {0};
    put_text(o->b, "<DataArray type=\"%s\" Name=\"%s\" NumberOfComponents=\"%d\" format=\"%s\"", type, name, components,
             forms[o->form]);
    if (o->form >= XML_APPENDED_RAW)
        put_text(o->b, " offset=\"%zu\"", o->appended.length);
    put_text(o->b, ">");
    put(&data, "", 0);
    for (size_t i = 0; i < count; i++) {
        uint8_t byte = (uint8_t)value[i];
        if (o->form == XML_ASCII)
            put_text(o->b, "%.17g\n", value[i]);
        else if (strcmp(type, "Float64") == 0)
            put_f64(&data, value[i], o->big);
        else if (strcmp(type, "Int64") == 0)
            put_u64(&data, (uint64_t)value[i], o->big);
        else if (strcmp(type, "Int32") == 0)
            put_i32(&data, (int32_t)value[i], o->big);
        else
            put_number(&data, &byte, 1, false);
    }
    if (o->form == XML_INLINE)
        put_block(o, o->b, true, &data);
    else if (o->form != XML_ASCII)
        put_block(o, &o->appended, o->form == XML_APPENDED_BASE64, &data);
    put_text(o->b, "</DataArray>\n");
    free(data.data);
}

static inline void put_vtk_head(struct xml_out *o, const char *type)
{
    put_text(
        o->b,
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"%s\" version=\"1.0\" byte_order=\"%s\" header_type=\"%s\"%s>\n<%s>\n",
        type, o->big ? "BigEndian" : "LittleEndian", o->wide ? "UInt64" : "UInt32",
        o->packed ? " compressor=\"vtkZLibDataCompressor\"" : "", type);
}

static inline void put_vtk_tail(struct xml_out *o, const char *type)
{
    put_text(o->b, "</Piece></%s>\n", type);
    if (o->form >= XML_APPENDED_RAW) {
        put_text(o->b, "<AppendedData encoding=\"%s\">\n  _", o->form == XML_APPENDED_RAW ? "raw" : "base64");
        put(o->b, o->appended.data, o->appended.length);
        put_text(o->b, "\n</AppendedData>\n");
    }
    put_text(o->b, "</VTKFile>\n");
    free(o->appended.data);
}

static inline void encode_vtu(const struct mesh *m, enum xml_form form, bool big, bool wide, bool packed,
                              struct bytes *b)
{
    struct xml_out o = {.form = form, .big = big, .wide = wide, .packed = packed, .b = b};
    size_t n = m->tetrahedron_count;
    double *list = malloc(4 * n * sizeof *list);
    put_vtk_head(&o, "UnstructuredGrid");
    put_text(b, "<Piece NumberOfPoints=\"%zu\" NumberOfCells=\"%zu\">\n<CellData>\n", m->node_count, n);
    for (size_t e = 0; e < n; e++)
        list[e] = m->labels[e];
    put_array(&o, "Material", "Int32", 1, list, n);
    put_text(b, "</CellData><Points>\n");
    put_array(&o, "Points", "Float64", 3, m->nodes, 3 * m->node_count);
    put_text(b, "</Points><Cells>\n");
    for (size_t i = 0; i < 4 * n; i++)
        list[i] = m->tetrahedra[i];
    put_array(&o, "connectivity", "Int64", 1, list, 4 * n);
    for (size_t e = 0; e < n; e++)
        list[e] = 4.0 * (double)(e + 1);
    put_array(&o, "offsets", "Int64", 1, list, n);
    for (size_t e = 0; e < n; e++)
        list[e] = 10;
    put_array(&o, "types", "UInt8", 1, list, n);
    put_text(b, "</Cells>\n");
    put_vtk_tail(&o, "UnstructuredGrid");
    free(list);
}

static inline void encode_tetgen(const struct mesh *m, unsigned base, struct bytes *node, struct bytes *ele)
{
    put_text(node, "# nodes\n%zu 3 1 1\n", m->node_count);
    for (size_t i = 0; i < m->node_count; i++)
        put_text(node, "  %zu  %.17g %.17g %.17g  0.5 1\n", i + base, m->nodes[3 * i], m->nodes[3 * i + 1],
                 m->nodes[3 * i + 2]);
    put_text(ele, "%zu 4 1\n", m->tetrahedron_count);
    for (size_t e = 0; e < m->tetrahedron_count; e++) {
        const uint32_t *t = m->tetrahedra + 4 * e;
        put_text(ele, "%zu %u %u %u %u %d # here\n", e + base, t[0] + base, t[1] + base, t[2] + base, t[3] + base,
                 m->labels[e]);
    }
}

static inline void encode_vega(const struct mesh *m, unsigned base, struct bytes *b)
{
    put_text(b, "# Vega\n*VERTICES\n%zu 3 0 0\n", m->node_count);
    for (size_t i = 0; i < m->node_count; i++)
        put_text(b, "%zu %.17g %.17g %.17g\n", i + base, m->nodes[3 * i], m->nodes[3 * i + 1], m->nodes[3 * i + 2]);
    put_text(b, "\n*ELEMENTS\nTET\n%zu 4 0\n", m->tetrahedron_count);
    for (size_t e = 0; e < m->tetrahedron_count; e++) {
        const uint32_t *t = m->tetrahedra + 4 * e;
        put_text(b, "%zu %u %u %u %u\n", e + base, t[0] + base, t[1] + base, t[2] + base, t[3] + base);
    }
    put_text(b, "*MATERIAL left\nENU, 1000, 1E5, 0.4\n*MATERIAL right\nENU, 1000, 1E5, 0.4\n*SET second\n");
    for (size_t e = 0; e < m->tetrahedron_count; e++)
        if (m->labels[e] == 2)
            put_text(b, "%zu,%s", e + base, e % 5 ? " " : "\n");
    put_text(b, "\n*REGION\nallElements, left\n*REGION\nsecond, right\n");
}

/* The surface of a mesh as a file of triangles. */
static inline const double *corner_of(const struct mesh *m, const struct surface *s, size_t i)
{
    return m->nodes + 3 * (size_t)s->node[s->triangles[i]];
}

static inline void encode_stl(const struct mesh *m, const struct surface *s, bool binary, struct bytes *b)
{
    char head[80] = "solid that is binary all the same";
    if (binary) {
        put(b, head, sizeof head);
        put_i32(b, (int32_t)s->triangle_count, false);
    } else {
        put_text(b, "solid box\n");
    }
    for (size_t t = 0; t < s->triangle_count; t++) {
        if (!binary)
            put_text(b, "facet normal 0 0 nan\n outer loop\n");
        for (int k = 0; k < 3 && binary; k++)
            put_f32(b, 0, false);
        for (int i = 0; i < 3; i++) {
            const double *x = corner_of(m, s, 3 * t + (size_t)i);
            for (int k = 0; k < 3 && binary; k++)
                put_f32(b, (float)x[k], false);
            if (!binary)
                put_text(b, "  vertex %.9g %.9g %.9g\n", x[0], x[1], x[2]);
        }
        binary ? put(b, "\0\0", 2) : put_text(b, " endloop\nendfacet\n");
    }
    if (!binary)
        put_text(b, "endsolid box\n");
}

static inline void encode_obj(const struct mesh *m, const struct surface *s, struct bytes *b)
{
    put_text(b, "# OBJ\nmtllib none.mtl\no box\ng default\n");
    for (size_t v = 0; v < s->vertex_count; v++) {
        const double *x = m->nodes + 3 * (size_t)s->node[v];
        put_text(b, "v %.17g %.17g %.17g\n", x[0], x[1], x[2]);
    }
    put_text(b, "vt 0 0\nvn 0 0 1\ns off\nusemtl skin\n");
    for (size_t t = 0; t < s->triangle_count; t++) {
        const uint32_t *v = s->triangles + 3 * t;
        if (t % 3 == 0)
            put_text(b, "f %u//1 %u//1 %u//1\n", v[0] + 1, v[1] + 1, v[2] + 1);
        else if (t % 3 == 1)
            put_text(b, "f %u/1/1 %u/1 %u\n", v[0] + 1, v[1] + 1, v[2] + 1);
        else
            put_text(b, "f %d %d \\\n %d\n", (int)v[0] - (int)s->vertex_count, (int)v[1] - (int)s->vertex_count,
                     (int)v[2] - (int)s->vertex_count);
    }
}

static inline void encode_ply(const struct mesh *m, const struct surface *s, int form, struct bytes *b)
{
    static const char *const forms[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    put_text(b,
             "ply\nformat %s 1.0\ncomment none\nelement vertex %zu\nproperty float nx\nproperty double x\nproperty "
             "double y\n"
             "property double z\nproperty uchar red\nelement face %zu\nproperty uchar flags\n"
             "property list uchar int vertex_indices\nelement edge 1\nproperty int vertex1\nend_header\n",
             forms[form], s->vertex_count, s->triangle_count);
    for (size_t v = 0; v < s->vertex_count; v++) {
        const double *x = m->nodes + 3 * (size_t)s->node[v];
        if (!form) {
            put_text(b, "0 %.17g %.17g %.17g 255\n", x[0], x[1], x[2]);
            continue;
        }
        put_f32(b, 0, form == 2);
        for (int k = 0; k < 3; k++)
            put_f64(b, x[k], form == 2);
        put(b, "\xff", 1);
    }
    for (size_t t = 0; t < s->triangle_count; t++) {
        const uint32_t *v = s->triangles + 3 * t;
        if (!form) {
            put_text(b, "7 3 %u %u %u\n", v[0], v[1], v[2]);
            continue;
        }
        put(b, "\7\3", 2);
        for (int k = 0; k < 3; k++)
            put_i32(b, (int32_t)v[k], form == 2);
    }
    form ? put_i32(b, 0, form == 2) : put_text(b, "0\n");
}

static inline void encode_vtp(const struct mesh *m, const struct surface *s, enum xml_form form, bool packed,
                              struct bytes *b)
{
    struct xml_out o = {.form = form, .packed = packed, .b = b};
    size_t n = s->triangle_count;
    double *list = malloc(3 * (n + s->vertex_count) * sizeof *list);
    put_vtk_head(&o, "PolyData");
    put_text(b,
             "<Piece NumberOfPoints=\"%zu\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" "
             "NumberOfPolys=\"%zu\">\n<Points>\n",
             s->vertex_count, n);
    for (size_t i = 0; i < 3 * s->vertex_count; i++)
        list[i] = m->nodes[3 * (size_t)s->node[i / 3] + i % 3];
    put_array(&o, "Points", "Float64", 3, list, 3 * s->vertex_count);
    put_text(b, "</Points><Polys>\n");
    for (size_t i = 0; i < 3 * n; i++)
        list[i] = s->triangles[i];
    put_array(&o, "connectivity", "Int32", 1, list, 3 * n);
    for (size_t t = 0; t < n; t++)
        list[t] = 3.0 * (double)(t + 1);
    put_array(&o, "offsets", "Int32", 1, list, n);
    put_text(b, "</Polys>\n");
    put_vtk_tail(&o, "PolyData");
    free(list);
}

#endif
