/* Which material each element has: by label, by intensity, or both. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "csv.h"
#include "mesh_data.h"
#include "scene_keys.h"

int scene_mesh(const struct scene *scene, double size, struct mesh *mesh, struct failure *why)
{
    const char *name[SCENE_MAX_MATERIALS + 1];
    size_t names = 0;
    if (*scene->intensity_array && !*scene->intensity_path)
        name[names++] = scene->intensity_array;
    for (size_t m = 0; m < scene->material_count; m++)
        if (*scene->material[m].along_array)
            name[names++] = scene->material[m].along_array;
    return mesh_read_data(scene->mesh_path, size, name, names, mesh, why);
}

/* Nodes by their first coordinate. */
struct placed {
    double x;
    uint32_t node;
};

static int by_x(const void *a, const void *b)
{
    double x = ((const struct placed *)a)->x, y = ((const struct placed *)b)->x;
    return x < y ? -1 : x > y;
}

/* The node nearest to p within `near`, or UINT32_MAX. Looks at the nodes of a slab of that thickness only. */
static uint32_t node_at(const struct mesh *mesh, const struct placed *sorted, const double p[3], double near)
{
    size_t low = 0, high = mesh->node_count;
    while (low < high) {
        size_t middle = (low + high) / 2;
        if (sorted[middle].x < p[0] - near)
            low = middle + 1;
        else
            high = middle;
    }
    uint32_t best = UINT32_MAX;
    for (; low < mesh->node_count && sorted[low].x <= p[0] + near; low++) {
        const double *x = mesh->nodes + 3 * (size_t)sorted[low].node;
        double distance = hypot(hypot(x[0] - p[0], x[1] - p[1]), x[2] - p[2]);
        if (distance <= near) {
            near = distance;
            best = sorted[low].node;
        }
    }
    return best;
}

static int take_rows(const struct scene *scene, const struct csv *table, struct mesh *mesh, double *value,
                     struct placed *sorted, struct failure *why)
{
    size_t column[4];
    const char *const name[4] = {"x", "y", "z", scene->intensity_array};
    for (int c = 0; c < 4; c++) {
        int status = csv_column(table, name[c], &column[c], why);
        if (status)
            return status;
    }
    double extent = 0;
    for (size_t a = 0; a < 3; a++) {
        double low = INFINITY, high = -INFINITY;
        for (size_t n = 0; n < mesh->node_count; n++) {
            low = fmin(low, mesh->nodes[3 * n + a]);
            high = fmax(high, mesh->nodes[3 * n + a]);
        }
        extent = fmax(extent, high - low);
    }
    for (size_t n = 0; n < mesh->node_count; n++) {
        sorted[n] = (struct placed){mesh->nodes[3 * n], (uint32_t)n};
        value[n] = NAN;
    }
    qsort(sorted, mesh->node_count, sizeof *sorted, by_x);
    for (size_t r = 0; r < table->rows; r++) {
        const double *row = table->value + r * table->columns;
        double p[3] = {row[column[0]], row[column[1]], row[column[2]]};
        if (!(isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2])))
            return failure_at(why, STATUS_TABLE_SYNTAX, table->path, table->line[r], NULL, "a coordinate is missing");
        uint32_t node = node_at(mesh, sorted, p, 1e-5 * extent);
        if (node == UINT32_MAX)
            continue;
        if (!isnan(value[node]) && value[node] != row[column[3]])
            return failure_at(why, STATUS_TABLE_SYNTAX, table->path, table->line[r], "keep one of them",
                              "a second intensity at (%g, %g, %g): %g, before %g", p[0], p[1], p[2], row[column[3]],
                              value[node]);
        value[node] = row[column[3]];
    }
    return STATUS_OK;
}

int scene_intensities(const struct scene *scene, struct mesh *mesh, struct failure *why)
{
    if (!*scene->intensity_path)
        return STATUS_OK;
    struct csv table;
    double *value = malloc((mesh->node_count + 1) * sizeof *value);
    struct placed *sorted = malloc((mesh->node_count + 1) * sizeof *sorted);
    struct mesh_data *data = mesh_data_want(mesh, scene->intensity_array);
    int status = csv_read(scene->intensity_path, &table, why);
    if (status == STATUS_OK && !(value && sorted && data))
        status =
            failure_set(why, STATUS_MEMORY, scene->intensity_path, NULL, "no memory for %zu nodes", mesh->node_count);
    if (status == STATUS_OK)
        status = take_rows(scene, &table, mesh, value, sorted, why);
    if (status == STATUS_OK && !mesh_data_append(data, 1, value, mesh->node_count))
        status =
            failure_set(why, STATUS_MEMORY, scene->intensity_path, NULL, "no memory for %zu nodes", mesh->node_count);
    csv_free(&table);
    free(value);
    free(sorted);
    return status;
}

static int find_intensities(const struct scene *scene, const struct mesh *mesh, const struct mesh_data **data,
                            struct failure *why)
{
    *data = NULL;
    if (!*scene->intensity_array)
        return STATUS_OK;
    *data = mesh_data_find(mesh, scene->intensity_array);
    if (!*data)
        return failure_at(why, STATUS_MODEL_DATA, scene_place(scene), scene->intensity_line,
                          "name an array of the mesh's node data (VTK POINT_DATA, Gmsh $NodeData), or a CSV file",
                          "%s has no node data '%s'", mesh->path, scene->intensity_array);
    if ((*data)->components != 1)
        return failure_at(why, STATUS_MODEL_DATA, scene_place(scene), scene->intensity_line,
                          "name an array of single numbers", "the node data '%s' of %s have %zu components",
                          scene->intensity_array, mesh->path, (*data)->components);
    return STATUS_OK;
}

/* Every material's label occurs in the mesh. */
static int check_labels(const struct scene *scene, const struct mesh *mesh, struct failure *why)
{
    for (size_t m = 0; m < scene->material_count; m++) {
        bool occurs = strcmp(scene->material[m].label, "all") == 0;
        for (size_t i = 0; i < mesh->label_count && !occurs; i++)
            occurs = scene_label_matches(&mesh->label[i], scene->material[m].label);
        if (occurs)
            continue;
        char labels[200];
        scene_list_labels(mesh, labels, sizeof labels);
        return failure_at(why, STATUS_SCENE_VALUE, scene_place(scene), scene->material[m].line,
                          "name a label of the mesh, or all", "material for label '%s', but the mesh has only: %s",
                          scene->material[m].label, labels);
    }
    return STATUS_OK;
}

/* How well a material fits a label with an intensity (NaN: none is known): 0 not at all; a specific label counts more than
 * a range. */
static int rank(const struct scene_material *material, const struct mesh_label *label, double intensity)
{
    bool all = strcmp(material->label, "all") == 0;
    if (!all && !scene_label_matches(label, material->label))
        return 0;
    if (material->by_intensity && !(intensity >= material->intensity[0] && intensity < material->intensity[1]))
        return 0;
    return 1 + 2 * !all + material->by_intensity;
}

/* The material of a label with an intensity: its index, -1 for none; `second` fits as well, or is -1. */
static int material_for(const struct scene *scene, const struct mesh_label *label, double intensity, int *second)
{
    int best = -1, best_rank = 0;
    *second = -1;
    for (size_t m = 0; m < scene->material_count; m++) {
        int own = rank(&scene->material[m], label, intensity);
        if (own > best_rank) {
            best = (int)m;
            best_rank = own;
            *second = -1;
        } else if (own > 0 && own == best_rank) {
            *second = (int)m;
        }
    }
    return best;
}

static int no_material(const struct scene *scene, const struct mesh *mesh, const struct mesh_label *label, size_t e,
                       double intensity, struct failure *why)
{
    size_t elements = 0;
    for (size_t k = 0; k < mesh->tetrahedron_count; k++)
        elements += mesh->labels[k] == label->number;
    const char *quote = label->name[0] ? "'" : "", *space = label->name[0] ? " " : "";
    if (isnan(intensity))
        return failure_at(why, STATUS_MODEL_LABEL, scene_place(scene), scene->material[0].line, NULL,
                          "%zu elements with label %d%s%s%s%s have no material", elements, (int)label->number, space,
                          quote, label->name, quote);
    return failure_at(why, STATUS_MODEL_LABEL, scene_place(scene), scene->material[0].line,
                      "add a material whose intensity holds it, or one without intensity",
                      "element %zu (label %d%s%s%s%s) with mean intensity %g has no material", e, (int)label->number,
                      space, quote, label->name, quote, intensity);
}

/* Mean of the four vertices. */
static int mean_intensity(const struct mesh *mesh, const struct mesh_data *data, size_t e, double *mean,
                          struct failure *why)
{
    *mean = NAN;
    if (!data)
        return STATUS_OK;
    double sum = 0;
    for (size_t k = 0; k < 4; k++) {
        uint32_t node = mesh->tetrahedra[4 * e + k];
        const double *x = mesh->nodes + 3 * (size_t)node;
        if (!isfinite(data->value[node]))
            return failure_set(why, STATUS_MODEL_DATA, mesh->path, NULL,
                               "node %u at (%.4g, %.4g, %.4g) m has no intensity '%s'", node, x[0], x[1], x[2],
                               data->name);
        sum += data->value[node];
    }
    *mean = sum / 4;
    return STATUS_OK;
}

int scene_materials(const struct scene *scene, const struct mesh *mesh, uint8_t *material_of, struct failure *why)
{
    _Static_assert((int)SCENE_MAX_MATERIALS < (int)UINT8_MAX, "a material's number fits");
    const struct mesh_data *data;
    int status = find_intensities(scene, mesh, &data, why);
    if (status == STATUS_OK)
        status = check_labels(scene, mesh, why);
    for (size_t i = 0; i < mesh->label_count && status == STATUS_OK; i++) {
        const struct mesh_label *label = &mesh->label[i];
        int material = -1, second = -1;
        double intensity = NAN;
        if (!data) /* the same for all elements of the label */
            material = material_for(scene, label, intensity, &second);
        for (size_t e = 0; e < mesh->tetrahedron_count && status == STATUS_OK; e++) {
            if (mesh->labels[e] != label->number)
                continue;
            if (data) {
                status = mean_intensity(mesh, data, e, &intensity, why);
                if (status)
                    break;
                material = material_for(scene, label, intensity, &second);
            }
            if (material < 0)
                status = no_material(scene, mesh, label, e, intensity, why);
            else if (second >= 0)
                status =
                    failure_at(why, STATUS_SCENE_VALUE, scene_place(scene), scene->material[second].line,
                               "keep one of them", "label %d '%s' has two materials, '%s' and '%s'", (int)label->number,
                               label->name, scene->material[material].label, scene->material[second].label);
            else
                material_of[e] = (uint8_t)material;
        }
    }
    for (size_t e = 0, i; e < mesh->tetrahedron_count && status == STATUS_OK; e++) {
        for (i = 0; i < mesh->label_count && mesh->label[i].number != mesh->labels[e];)
            i++;
        if (i == mesh->label_count)
            status = failure_at(why, STATUS_MODEL_LABEL, scene_place(scene), 0, NULL, "element %zu has no material", e);
    }
    return status;
}
