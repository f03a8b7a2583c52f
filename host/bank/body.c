#include <libgen.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bank.h"
#include "crc.h"
#include "progress.h"

/* Element size for filling a surface is in metres in the scene, in file units for the mesher: without a unit the scale
 * follows from the surface's own extent, so it is read once at its own size first. */
static int size_in_file_units(const struct scene *scene, double *size, struct failure *why)
{
    *size = 0;
    if (!(scene->surface_size_m > 0))
        return STATUS_OK;
    if (!(scene->extent_m > 0)) {
        double metres = scene->unit == MESH_UNIT_MM ? 1e-3 : scene->unit == MESH_UNIT_CM ? 1e-2 : 1;
        *size = scene->surface_size_m / metres;
        return STATUS_OK;
    }
    struct mesh mesh = {0};
    int status = mesh_read(scene->mesh_path, 0, &mesh, why);
    if (status)
        return status;
    double extent = 0;
    for (int k = 0; k < 3; k++) {
        double low = INFINITY, high = -INFINITY;
        for (size_t n = 0; n < mesh.node_count; n++) {
            low = fmin(low, mesh.nodes[3 * n + k]);
            high = fmax(high, mesh.nodes[3 * n + k]);
        }
        extent = fmax(extent, high - low);
    }
    mesh_free(&mesh);
    *size = scene->surface_size_m * extent / scene->extent_m;
    return STATUS_OK;
}

int body_from_scene(const struct scene *scene, struct body *body, struct mesh_report *report, struct failure *why)
{
    struct mesh_report unused = {0};
    double size;
    *body = (struct body){.scene = *scene};
    int status = size_in_file_units(scene, &size, why);
    if (!status)
        status = scene_mesh(scene, size, &body->mesh, why);
    if (!status)
        status = mesh_check(&body->mesh, scene->allow_components, report ? report : &unused, why);
    if (!status)
        status = scene_intensities(scene, &body->mesh, why);
    if (!status)
        status = mesh_scale(&body->mesh, scene->extent_m, scene->unit, why);
    if (!status)
        status = mesh_surface(&body->mesh, &body->surface, why);
    if (!status)
        status = model_create(&body->scene, &body->mesh, &body->surface, &body->model, why);
    if (status) {
        body_close(body);
        return status;
    }
    scene_place_instruments(&body->scene, &body->mesh, &body->surface, model_fixed_vertices(body->model));
    return STATUS_OK;
}

void body_close(struct body *body)
{
    if (body->model)
        model_free(body->model);
    surface_free(&body->surface);
    mesh_free(&body->mesh);
    *body = (struct body){0};
}

/* Candidate k for the mesh's place; false when there are no more. */
static bool candidate(const struct bank_file *bank, int k, char *path, size_t room)
{
    char folder[1024], name[1024];
    snprintf(folder, sizeof folder, "%s", bank->path);
    snprintf(name, sizeof name, "%s", bank->mesh_path);
    const char *tail[] = {bank->provenance.mesh_from_bank, bank->mesh_path, basename(name)};
    if (k == 0)
        snprintf(path, room, "%s", bank->mesh_path);
    else if (k <= 3)
        snprintf(path, room, "%s%s%s", tail[k - 1][0] == '/' ? "" : dirname(folder), tail[k - 1][0] == '/' ? "" : "/",
                 tail[k - 1]);
    return k <= 3;
}

static int mesh_changed(const char *path, uint32_t now, uint32_t then, struct failure *why)
{
    return failure_set(why, STATUS_CHECK_FAILED, path, "restore that mesh, or rebuild the bank from this one",
                       "the mesh has changed since the bank was built: its CRC-32 is %08x, the bank's mesh had %08x",
                       now, then);
}

/* CRC-32 of a mesh file as mesh_read forms it: of the bytes; TetGen's is over two files and comes with reading them. */
static bool hash_mesh(const char *path, uint32_t *hash)
{
    struct failure ignored;
    const char *dot = strrchr(path, '.');
    if (dot && (!strcmp(dot, ".node") || !strcmp(dot, ".ele"))) {
        struct mesh mesh = {0};
        if (mesh_read(path, 0, &mesh, &ignored) != STATUS_OK)
            return false;
        *hash = mesh.file_hash;
        mesh_free(&mesh);
        return true;
    }
    unsigned char *bytes;
    size_t length;
    if (file_load(path, &bytes, &length, &ignored) != STATUS_OK)
        return false;
    *hash = crc32_update(0, bytes, length);
    free(bytes);
    return true;
}

/* First candidate whose bytes are those that the bank was built from. */
static int find_mesh(const struct bank_file *bank, struct scene *scene, struct failure *why)
{
    char path[2100], other[2100] = "";
    uint32_t hash, other_hash = 0, wanted = bank->view.header->mesh_hash;
    if (!*bank->mesh_path)
        return failure_set(why, STATUS_FILE_OPEN, bank->path, "name the scene with --scene FILE",
                           "the bank does not say which mesh it was built from");
    for (int k = 0; candidate(bank, k, path, sizeof path); k++) {
        if (strlen(path) >= sizeof scene->mesh_path || !hash_mesh(path, &hash))
            continue;
        if (hash == wanted) {
            strcpy(scene->mesh_path, path);
            return STATUS_OK;
        }
        if (!*other) {
            strcpy(other, path);
            other_hash = hash;
        }
    }
    if (*other)
        return mesh_changed(other, other_hash, wanted, why);
    return failure_set(why, STATUS_FILE_OPEN, bank->mesh_path, "put it back, or name a scene with --scene FILE",
                       "the mesh that the bank was built from is not found, neither here nor beside the bank");
}

/* Same surface as the bank's, to the last bit of float32. */
static bool same_surface(const struct bank_view *view, const struct body *body)
{
    const struct surface *s = &body->surface;
    if (s->vertex_count != view->vertex_count || s->triangle_count != view->triangle_count)
        return false;
    for (size_t v = 0; v < s->vertex_count; v++)
        for (int k = 0; k < 3; k++)
            if ((float)body->mesh.nodes[3 * s->node[v] + k] != view->positions[3 * v + k])
                return false;
    for (size_t t = 0; t < s->triangle_count; t++)
        for (int k = 0; k < 3; k++)
            if (s->triangles[3 * t + k] != view->triangles[t].vertex[k])
                return false;
    return true;
}

/* The scene's text as the bank holds it, whatever place its mesh was read from. */
static char *text_of(struct scene *scene)
{
    scene->path[0] = scene->mesh_path[0] = 0;
    return scene_print(scene);
}

/* A bank and a scene of the same mesh may still differ in what the body is made of, or where it is held. */
static int same_scene(const struct bank_file *bank, const struct body *body, const char *scene_path,
                      struct failure *why)
{
    if (!bank->scene_text)
        return STATUS_OK;
    struct scene *scene = malloc(sizeof *scene);
    if (!scene)
        return failure_set(why, STATUS_MEMORY, bank->path, NULL, "no memory for the scene");
    char *there = NULL, *here = NULL;
    int status = scene_parse(bank->scene_text, strlen(bank->scene_text), bank->path, scene, why);
    if (!status) {
        there = text_of(scene);
        *scene = body->scene;
        here = text_of(scene);
        if (!here || !there)
            status = failure_set(why, STATUS_MEMORY, bank->path, NULL, "no memory for the scene");
    }
    if (!status && strcmp(here, there) != 0) {
        size_t line = 0; /* start of the first line that differs */
        for (size_t i = 0; here[i] == there[i]; i++)
            line = here[i] == '\n' ? i + 1 : line;
        while (here[line] == ' ')
            line++;
        status =
            failure_set(why, STATUS_CHECK_FAILED, scene_path, "build the bank again, or take the scene it is from",
                        "%.200s is the bank of another scene: here \"%.*s\", there \"%.*s\"", bank->path,
                        (int)strcspn(here + line, "\n"), here + line, (int)strcspn(there + line, "\n"), there + line);
    }
    free(here);
    free(there);
    free(scene);
    return status;
}

int body_open(const struct bank_file *bank, const char *scene_path, struct body *body, struct failure *why)
{
    *body = (struct body){0};
    struct scene *scene = malloc(sizeof *scene);
    if (!scene)
        return failure_set(why, STATUS_MEMORY, bank->path, NULL, "no memory for the scene");
    int status;
    if (scene_path)
        status = scene_read(scene_path, scene, why);
    else if (!bank->scene_text)
        status = failure_set(why, STATUS_FILE_OPEN, bank->path, "name the scene with --scene FILE",
                             "the bank does not hold the scene that it was built from");
    else {
        status = scene_parse(bank->scene_text, strlen(bank->scene_text), bank->path, scene, why);
        if (!status)
            status = find_mesh(bank, scene, why);
    }
    if (!status)
        status = body_from_scene(scene, body, NULL, why);
    free(scene);
    if (status)
        return status;
    uint32_t now = body->mesh.file_hash, then = bank->view.header->mesh_hash;
    if (now != then)
        status = mesh_changed(body->scene.mesh_path, now, then, why);
    else if (!same_surface(&bank->view, body))
        status = failure_set(why, STATUS_CHECK_FAILED, body->scene.mesh_path, "rebuild the bank from its scene",
                             "the mesh is the bank's, but read with this scene it gives another surface");
    else if (scene_path)
        status = same_scene(bank, body, scene_path, why);
    if (status)
        body_close(body);
    return status;
}
