#include "mesh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "crc.h"
#include "mesh_data.h"
#include "mesh_readers.h"
#include "progress.h"

/* Files that people give by mistake, by their first bytes. */
static const struct {
    const char *name, *mark;
    size_t length;
} foreign[] = {
    {"a PNG image", "\x89PNG", 4},
    {"a JPEG image", "\xff\xd8\xff", 3},
    {"a GIF image", "GIF8", 4},
    {"a PDF document", "%PDF", 4},
    {"a program (ELF)",
     "\x7f"
     "ELF",
     4},
    {"a ZIP archive", "PK\x03\x04", 4},
    {"a gzip archive", "\x1f\x8b", 2},
    {"an xz archive",
     "\xfd"
     "7zXZ",
     5},
    {"an HDF5 file", "\x89HDF", 4},
    {"a script", "#!", 2},
    {"a Trocar bank", "TRCB", 4},
};

enum mesh_format {
    FORMAT_NONE,
    FORMAT_GMSH,
    FORMAT_VTK,
    FORMAT_VTK_XML,
    FORMAT_TETGEN,
    FORMAT_VEGA,
    FORMAT_STL,
    FORMAT_OBJ,
    FORMAT_PLY,
    FORMAT_GEO
};

static const struct {
    const char *extension;
    enum mesh_format format;
} extensions[] = {
    {".msh", FORMAT_GMSH},    {".vtk", FORMAT_VTK},    {".vtu", FORMAT_VTK_XML}, {".vtp", FORMAT_VTK_XML},
    {".node", FORMAT_TETGEN}, {".ele", FORMAT_TETGEN}, {".veg", FORMAT_VEGA},    {".stl", FORMAT_STL},
    {".obj", FORMAT_OBJ},     {".ply", FORMAT_PLY},    {".geo", FORMAT_GEO},
};

bool mesh_has_extension(const char *path, const char *extension)
{
    size_t n = strlen(path), m = strlen(extension);
    return n > m && strcasecmp(path + n - m, extension) == 0;
}

static bool begins(const struct scan *s, const char *word)
{
    size_t n = strlen(word);
    return s->length >= n && memcmp(s->bytes, word, n) == 0;
}

static bool head_has(const struct scan *s, const char *word)
{
    return memmem(s->bytes, s->length < 4096 ? s->length : 4096, word, strlen(word)) != NULL;
}

static int not_a_mesh(struct scan *s)
{
    if (s->length == 0)
        return failure_set(s->why, STATUS_MESH_FORMAT, s->path, NULL, "the file is empty");
    for (size_t i = 0; i < sizeof foreign / sizeof foreign[0]; i++)
        if (s->length >= foreign[i].length && memcmp(s->bytes, foreign[i].mark, foreign[i].length) == 0)
            return failure_set(s->why, STATUS_MESH_FORMAT, s->path, NULL, "this is %s, not a mesh", foreign[i].name);
    return failure_set(s->why, STATUS_MESH_FORMAT, s->path, NULL,
                       "neither the content nor the extension is that of a known mesh format");
}

/* Content first, extension where content is only numbers. */
static enum mesh_format format_of(struct scan *s)
{
    const char *token;
    struct scan peek = *s;
    size_t n = scan_peek(&peek, &token);
    if (begins(s, "# vtk DataFile"))
        return FORMAT_VTK;
    if (begins(s, "ply\n") || begins(s, "ply\r\n"))
        return FORMAT_PLY;
    if (n > 1 && token[0] == '$' && token[1] >= 'A' && token[1] <= 'Z')
        return FORMAT_GMSH;
    if (n > 0 && token[0] == '<' && head_has(s, "<VTKFile"))
        return FORMAT_VTK_XML;
    if (begins(s, "solid") && head_has(s, "facet"))
        return FORMAT_STL;
    for (size_t i = 0; i < sizeof foreign / sizeof foreign[0]; i++)
        if (s->length >= foreign[i].length && memcmp(s->bytes, foreign[i].mark, foreign[i].length) == 0)
            return FORMAT_NONE;
    for (size_t i = 0; i < sizeof extensions / sizeof extensions[0] && s->length > 0; i++)
        if (mesh_has_extension(s->path, extensions[i].extension))
            return extensions[i].format;
    if (n > 0 && head_has(s, "*VERTICES"))
        return FORMAT_VEGA;
    return FORMAT_NONE;
}

static int read_format(struct scan *s, enum mesh_format format, struct mesh *mesh, struct soup *soup, bool *is_surface)
{
    *is_surface = format == FORMAT_STL || format == FORMAT_OBJ || format == FORMAT_PLY;
    switch (format) {
    case FORMAT_GMSH:
        return read_gmsh(s, mesh);
    case FORMAT_VTK:
        return read_vtk(s, mesh, soup, is_surface);
    case FORMAT_VTK_XML:
        return read_vtk_xml(s, mesh, soup, is_surface);
    case FORMAT_TETGEN:
        return read_tetgen(s, mesh);
    case FORMAT_VEGA:
        return read_vega(s, mesh);
    case FORMAT_STL:
        return read_stl(s, soup);
    case FORMAT_OBJ:
        return read_obj(s, soup);
    case FORMAT_PLY:
        return read_ply(s, soup);
    default:
        return not_a_mesh(s);
    }
}

static int dispatch(struct scan *s, double surface_size, struct mesh *mesh)
{
    struct soup soup = {0};
    bool is_surface;
    enum mesh_format format = format_of(s);
    if (format == FORMAT_GEO)
        return mesh_geometry(surface_size, s->path, mesh, s->why);
    int status = read_format(s, format, mesh, &soup, &is_surface);
    if (status == STATUS_OK && is_surface)
        status = soup_close(&soup, s->path, s->why);
    if (status == STATUS_OK && is_surface)
        status = mesh_fill(&soup, surface_size, s->path, mesh, s->why);
    soup_free(&soup);
    return status;
}

int mesh_read(const char *path, double surface_size, struct mesh *mesh, struct failure *why)
{
    return mesh_read_data(path, surface_size, NULL, 0, mesh, why);
}

int mesh_read_data(const char *path, double surface_size, const char *const *name, size_t names, struct mesh *mesh,
                   struct failure *why)
{
    unsigned char *bytes;
    size_t length;
    *mesh = (struct mesh){0};
    for (size_t i = 0; i < names; i++)
        if (!mesh_data_want(mesh, name[i])) {
            mesh_free(mesh);
            return failure_set(why, STATUS_MEMORY, path, NULL, "no memory for the arrays of the mesh");
        }
    int status = file_load(path, &bytes, &length, why);
    if (status) {
        mesh_free(mesh);
        return status;
    }
    struct scan s = scan_start(path, bytes, length, why);
    status = dispatch(&s, surface_size, mesh);
    if (mesh->file_hash == 0) /* TetGen's reader has taken both files */
        mesh->file_hash = crc32_update(0, bytes, length);
    snprintf(mesh->path, sizeof mesh->path, "%s", path);
    free(bytes);
    mesh_data_settle(mesh);
    if (status)
        mesh_free(mesh);
    return status;
}

bool mesh_is_known(const char *path)
{
    unsigned char *bytes;
    size_t length;
    struct failure ignored;
    if (file_load(path, &bytes, &length, &ignored) != STATUS_OK)
        return false;
    struct scan s = scan_start(path, bytes, length, &ignored);
    bool known = format_of(&s) != FORMAT_NONE;
    free(bytes);
    return known;
}

int mesh_scale(struct mesh *mesh, double extent_m, enum mesh_unit unit, struct failure *why)
{
    static const double metres[] = {[MESH_UNIT_M] = 1, [MESH_UNIT_CM] = 1e-2, [MESH_UNIT_MM] = 1e-3};
    double factor;
    if (extent_m > 0 && isfinite(extent_m)) {
        double longest = 0;
        for (int k = 0; k < 3; k++) {
            double low = INFINITY, high = -INFINITY;
            for (size_t i = 0; i < mesh->node_count; i++) {
                low = fmin(low, mesh->nodes[3 * i + k]);
                high = fmax(high, mesh->nodes[3 * i + k]);
            }
            longest = fmax(longest, high - low);
        }
        if (!(longest > 0) || !isfinite(extent_m / longest))
            return failure_set(why, STATUS_MESH_DEGENERATE, mesh->path, NULL, "all nodes stand at one place");
        factor = extent_m / longest;
    } else if (extent_m != 0) {
        return failure_set(why, STATUS_MESH_SIZE, mesh->path, NULL, "the extent is %g m", extent_m);
    } else if (unit == MESH_UNIT_M || unit == MESH_UNIT_CM || unit == MESH_UNIT_MM) {
        factor = metres[unit];
    } else {
        return failure_set(why, STATUS_MESH_SIZE, mesh->path, NULL, "the length unit of the mesh is not known");
    }
    for (size_t i = 0; i < 3 * mesh->node_count; i++)
        mesh->nodes[i] *= factor;
    return STATUS_OK;
}

void mesh_free(struct mesh *mesh)
{
    free(mesh->nodes);
    free(mesh->tetrahedra);
    free(mesh->labels);
    free(mesh->label);
    mesh_data_free(mesh);
    *mesh = (struct mesh){0};
}
