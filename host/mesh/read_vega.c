/* Vega's .veg, as its library's "volumetricMesh" reads it: sections that begin with *NAME, lists with commas, # comments. */
#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "mesh_build.h"
#include "mesh_node_ids.h"
#include "mesh_readers.h"
#include "progress.h"

enum { DEEPEST = 8, NAME = 64 };

enum section { NONE, VERTICES, ELEMENTS, MATERIAL, SET, REGION };

struct set {
    char name[NAME];
    size_t count, room;
    int64_t *element;
};

struct region {
    char set[NAME], material[NAME];
    long line;
};

struct vega {
    struct mesh *mesh;
    struct build build;
    struct node_ids ids, element_ids;
    enum section section;
    size_t lines; /* of content read in the section */
    size_t vertex_count, element_count, vertices, elements;
    char (*material)[NAME];
    size_t material_count;
    struct set *set;
    size_t set_count;
    struct region *region;
    size_t region_count;
};

/* One more entry in a list that grows by one; NULL if there is no memory. Lists are short or grow with the file. */
static void *extend(void *list, size_t *count, size_t each)
{
    if ((*count & (*count - 1)) == 0) { /* at every power of two, room for twice as many */
        void *larger = realloc(list, (*count ? 2 * *count : 1) * each);
        if (!larger)
            return NULL;
        list = larger;
    }
    memset((char *)list + *count * each, 0, each);
    ++*count;
    return list;
}

static void past_comma(struct scan *s)
{
    if (scan_more_on_line(s) && s->bytes[s->at] == ',')
        s->at++;
}

static int integer(struct scan *s, int64_t lowest, int64_t highest, int64_t *value, const char *what)
{
    int status = scan_integer(s, lowest, highest, value, what);
    past_comma(s);
    return status;
}

/* A word up to a comma, blank or the line's end. */
static int name(struct scan *s, char word[NAME], const char *what)
{
    size_t n = 0;
    while (scan_more_on_line(s) && s->bytes[s->at] == ',')
        s->at++;
    if (!scan_more_on_line(s))
        return scan_fail(s, STATUS_MESH_SYNTAX, "%s should follow on this line", what);
    while (s->at < s->length && !isspace(s->bytes[s->at]) && s->bytes[s->at] != ',' && s->bytes[s->at]) {
        if (n < NAME - 1)
            word[n++] = (char)s->bytes[s->at];
        s->at++;
    }
    word[n] = 0;
    if (n == 0)
        return scan_fail(s, STATUS_MESH_SYNTAX, "%s should stand here", what);
    return STATUS_OK;
}

static int vertex_line(struct vega *v, struct scan *s)
{
    int64_t count, dimension, number;
    if (v->lines == 1) {
        int status = integer(s, 0, UINT32_MAX - 1, &count, "the number of vertices");
        if (status == STATUS_OK)
            status = integer(s, 3, 3, &dimension, "the dimension (3)");
        v->vertex_count = status ? 0 : (size_t)count;
        if (status == STATUS_OK) /* an included file may hold them: room grows with what is read */
            status = node_ids_start(&v->ids, 64, s->path, s->why);
        return status;
    }
    if (v->vertices == v->vertex_count)
        return scan_fail(s, STATUS_MESH_SYNTAX, "more than the %zu vertices announced", v->vertex_count);
    int status = integer(s, 0, INT32_MAX, &number, "the number of a vertex");
    if (status == STATUS_OK)
        status = build_nodes(&v->build, s, 1);
    for (int k = 0; k < 3 && status == STATUS_OK; k++) {
        status = scan_double(s, v->mesh->nodes + 3 * v->vertices + k, "a coordinate");
        past_comma(s);
    }
    if (status == STATUS_OK && !node_ids_add(&v->ids, number))
        status = scan_fail(s, STATUS_MEMORY, "no memory for the vertices");
    v->vertices += status == STATUS_OK;
    return status;
}

static int element_head(struct vega *v, struct scan *s)
{
    char type[NAME];
    int64_t count, corners;
    if (v->lines == 1) {
        int status = name(s, type, "the type of the elements");
        if (status == STATUS_OK && strcmp(type, "TET") != 0 && strcmp(type, "TETS") != 0)
            return scan_fail_remedy(s, STATUS_MESH_FORMAT, "split them into tetrahedra, then export again",
                                    "the elements are %.20s, not TET", type);
        return status;
    }
    int status = integer(s, 0, UINT32_MAX / 4, &count, "the number of elements");
    if (status == STATUS_OK)
        status = integer(s, 4, 4, &corners, "the number of corners (4)");
    v->element_count = status ? 0 : (size_t)count;
    if (status == STATUS_OK)
        status = node_ids_start(&v->element_ids, 64, s->path, s->why);
    return status;
}

static int element_line(struct vega *v, struct scan *s)
{
    int64_t number, node, twice;
    uint32_t corner[4];
    if (v->lines <= 2)
        return element_head(v, s);
    if (v->elements == v->element_count)
        return scan_fail(s, STATUS_MESH_SYNTAX, "more than the %zu elements announced", v->element_count);
    if (v->elements == 0 && !node_ids_finish(&v->ids, &twice))
        return scan_fail(s, STATUS_MESH_SYNTAX, "two vertices have the number %lld", (long long)twice);
    int status = integer(s, 0, INT32_MAX, &number, "the number of an element");
    for (int k = 0; k < 4 && status == STATUS_OK; k++) {
        status = integer(s, INT32_MIN, INT32_MAX, &node, "a corner");
        corner[k] = status ? UINT32_MAX : node_ids_place(&v->ids, node);
        if (status == STATUS_OK && corner[k] == UINT32_MAX)
            return scan_fail(s, STATUS_MESH_INDEX, "element %lld names vertex %lld, which does not exist",
                             (long long)number, (long long)node);
    }
    if (status == STATUS_OK)
        status = build_tetrahedron(&v->build, s, corner, 0);
    if (status == STATUS_OK && !node_ids_add(&v->element_ids, number))
        status = scan_fail(s, STATUS_MEMORY, "no memory for the elements");
    v->elements += status == STATUS_OK;
    return status;
}

static int set_line(struct vega *v, struct scan *s)
{
    struct set *set = &v->set[v->set_count - 1];
    int status = STATUS_OK;
    while (status == STATUS_OK && scan_more_on_line(s)) {
        int64_t number;
        status = integer(s, 0, INT32_MAX, &number, "an element of the set");
        if (status)
            break;
        int64_t *larger = extend(set->element, &set->count, sizeof *set->element);
        if (!larger)
            return scan_fail(s, STATUS_MEMORY, "no memory for the set %s", set->name);
        set->element = larger;
        set->element[set->count - 1] = number;
    }
    return status;
}

static int region_line(struct vega *v, struct scan *s)
{
    struct region *larger = extend(v->region, &v->region_count, sizeof *v->region);
    if (!larger)
        return scan_fail(s, STATUS_MEMORY, "no memory for the regions");
    v->region = larger;
    struct region *region = &v->region[v->region_count - 1];
    region->line = s->line;
    int status = name(s, region->set, "the name of a set");
    return status ? status : name(s, region->material, "the name of a material");
}

static int start_section(struct vega *v, struct scan *s, const char *word)
{
    static const char *const words[] = {"", "*VERTICES", "*ELEMENTS", "*MATERIAL", "*SET", "*REGION"};
    v->section = NONE;
    v->lines = 0;
    for (int i = 1; i < 6; i++)
        if (strcmp(word, words[i]) == 0)
            v->section = (enum section)i;
    if (v->section == NONE)
        return scan_fail(s, STATUS_MESH_SYNTAX, "the section \"%.30s\" is not known", word);
    if ((v->section == VERTICES && v->ids.id) || (v->section == ELEMENTS && v->element_ids.id))
        return scan_fail(s, STATUS_MESH_SYNTAX, "a second section %s", word);
    if (v->section == ELEMENTS && !v->ids.id)
        return scan_fail(s, STATUS_MESH_SYNTAX, "elements stand before the vertices");
    if (v->section == SET) {
        struct set *larger = extend(v->set, &v->set_count, sizeof *v->set);
        if (!larger)
            return scan_fail(s, STATUS_MEMORY, "no memory for the sets");
        v->set = larger;
        return name(s, v->set[v->set_count - 1].name, "the name of the set");
    }
    if (v->section == MATERIAL) {
        void *larger = extend(v->material, &v->material_count, NAME);
        if (!larger)
            return scan_fail(s, STATUS_MEMORY, "no memory for the materials");
        v->material = larger;
        return name(s, v->material[v->material_count - 1], "the name of the material");
    }
    return STATUS_OK;
}

static int read_lines(struct vega *v, struct scan *s, int depth);

/* A missing file leaves the section without its lines: sets stay empty and the reader says so; vertices and elements are
 * missed by their count. */
static int include(struct vega *v, struct scan *s, int depth)
{
    char file[256];
    struct stat info;
    int status = scan_word(s, file, sizeof file, "the name of a file");
    if (status)
        return status;
    if (depth == DEEPEST)
        return scan_fail(s, STATUS_MESH_SYNTAX, "files include each other more than %d deep", DEEPEST);
    const char *slash = strrchr(s->path, '/');
    int folder = slash && file[0] != '/' ? (int)(slash + 1 - s->path) : 0;
    char *path;
    if (asprintf(&path, "%.*s%s", folder, s->path, file) < 0)
        return scan_fail(s, STATUS_MEMORY, "no memory for a path");
    if (v->section == SET && stat(path, &info) != 0) {
        if (!*v->mesh->warning)
            snprintf(v->mesh->warning, sizeof v->mesh->warning,
                     "line %ld: the included file %.200s is missing; elements of the set %s have label 0", s->line,
                     file, v->set[v->set_count - 1].name);
        free(path);
        return STATUS_OK;
    }
    if (stat(path, &info) == 0 && !S_ISREG(info.st_mode)) {
        free(path);
        return scan_fail(s, STATUS_MESH_SYNTAX, "the included %.200s is not a file", file);
    }
    unsigned char *bytes;
    size_t length;
    status = file_load(path, &bytes, &length, s->why);
    if (status == STATUS_OK) {
        struct scan inner = scan_start(path, bytes, length, s->why);
        inner.comment = '#';
        status = read_lines(v, &inner, depth + 1);
        free(bytes);
    }
    free(path);
    return status;
}

static int read_lines(struct vega *v, struct scan *s, int depth)
{
    int status = STATUS_OK;
    while (status == STATUS_OK && scan_skip(s)) {
        if (s->bytes[s->at] == '*') {
            char word[32];
            status = scan_word(s, word, sizeof word, "a section");
            if (status == STATUS_OK)
                status = strcmp(word, "*INCLUDE") == 0 ? include(v, s, depth) : start_section(v, s, word);
            if (status == STATUS_OK && scan_more_on_line(s))
                status = scan_fail(s, STATUS_MESH_SYNTAX, "something follows %s on its line", word);
            continue;
        }
        v->lines++;
        switch (v->section) {
        case NONE:
            return scan_fail(s, STATUS_MESH_SYNTAX, "a section (*VERTICES) should begin here");
        case VERTICES:
            status = vertex_line(v, s);
            break;
        case ELEMENTS:
            status = element_line(v, s);
            break;
        case MATERIAL:
            break; /* elastic constants are the scene's */
        case SET:
            status = set_line(v, s);
            break;
        case REGION:
            status = region_line(v, s);
            break;
        }
        if (v->section != SET)
            scan_next_line(s);
    }
    return status;
}

/* Labels: the place of the region's material, from 1. A later region wins. */
static int assign(struct vega *v, struct scan *s)
{
    int64_t twice;
    if (!node_ids_finish(&v->element_ids, &twice))
        return scan_fail(s, STATUS_MESH_SYNTAX, "two elements have the number %lld", (long long)twice);
    for (size_t r = 0; r < v->region_count; r++) {
        const struct region *region = &v->region[r];
        size_t material = 0, set = 0;
        s->line = region->line;
        while (material < v->material_count && strcmp(v->material[material], region->material) != 0)
            material++;
        if (material == v->material_count)
            return scan_fail(s, STATUS_MESH_SYNTAX, "a region names the material %s, which is not there",
                             region->material);
        int status = build_name(&v->build, s, (int32_t)material + 1, region->material, strlen(region->material));
        if (status)
            return status;
        if (strcmp(region->set, "allElements") == 0) {
            for (size_t e = 0; e < v->elements; e++)
                v->mesh->labels[e] = (int32_t)material + 1;
            continue;
        }
        while (set < v->set_count && strcmp(v->set[set].name, region->set) != 0)
            set++;
        if (set == v->set_count)
            return scan_fail(s, STATUS_MESH_SYNTAX, "a region names the set %s, which is not there", region->set);
        for (size_t i = 0; i < v->set[set].count; i++) {
            uint32_t place = node_ids_place(&v->element_ids, v->set[set].element[i]);
            if (place == UINT32_MAX)
                return scan_fail(s, STATUS_MESH_INDEX, "the set %s names element %lld, which does not exist",
                                 region->set, (long long)v->set[set].element[i]);
            v->mesh->labels[place] = (int32_t)material + 1;
        }
    }
    return STATUS_OK;
}

int read_vega(struct scan *s, struct mesh *mesh)
{
    struct vega v = {.mesh = mesh, .build = {.mesh = mesh}};
    s->comment = '#';
    int status = read_lines(&v, s, 0);
    if (status == STATUS_OK && (!v.element_ids.id || v.vertices != v.vertex_count || v.elements != v.element_count))
        status = scan_fail(s, STATUS_MESH_SYNTAX, "the file ends after %zu of %zu vertices and %zu of %zu elements",
                           v.vertices, v.vertex_count, v.elements, v.element_count);
    if (status == STATUS_OK)
        status = assign(&v, s);
    if (status == STATUS_OK)
        status = build_finish(&v.build, s);
    build_free(&v.build);
    node_ids_free(&v.ids);
    node_ids_free(&v.element_ids);
    free(v.material);
    for (size_t i = 0; i < v.set_count; i++)
        free(v.set[i].element);
    free(v.set);
    free(v.region);
    return status;
}
