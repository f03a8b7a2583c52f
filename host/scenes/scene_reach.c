/* Whether a placed instrument can touch the body at all, and whether its tip can be reported. */
#include "scene.h"

#include <math.h>

/* Of the wire's ForcePose, 20 bits of 2 um each (shared/wire.dbc), less a little for what bends. */
#define PI 3.14159265358979323846

static const double LARGEST_POSITION_m = 1.04;

struct seen { /* a point from an instrument's trocar */
    double distance_m, off_axis_rad;
    double joint_rad[2];
};

static struct seen look(const struct bank_tool *tool, const double point[3])
{
    double local[3] = {0, 0, 0}, square = 0;
    for (int i = 0; i < 3; i++) {
        double d = point[i] - tool->trocar_m[i];
        square += d * d;
        for (int k = 0; k < 3; k++)
            local[k] += tool->rotation[3 * i + k] * d;
    }
    struct seen p = {.distance_m = sqrt(square), .off_axis_rad = atan2(hypot(local[0], local[1]), local[2])};
    for (int k = 0; k < 2; k++)
        p.joint_rad[k] = p.distance_m > 0 ? asin(fmax(-1, fmin(1, local[k] / p.distance_m))) : 0;
    return p;
}

static bool within(double value, const struct bank_axis *axis)
{
    return value >= axis->minimum && value <= axis->maximum;
}

/* The tip's points reach a tip's diameter around it. */
static bool touches(const struct bank_tool *tool, const struct seen *p)
{
    double slack = 2 * (double)tool->tip_radius_m;
    return p->distance_m >= tool->axis[2].minimum - slack && p->distance_m <= tool->axis[2].maximum + slack &&
           p->off_axis_rad < PI / 2 && within(p->joint_rad[0], &tool->axis[0]) &&
           within(p->joint_rad[1], &tool->axis[1]);
}

static int check_one(const struct scene_instrument *instrument, const struct mesh *mesh, const struct surface *surface,
                     const char *place, struct failure *why)
{
    struct bank_tool tool;
    int status = scene_tool(instrument, &tool, why);
    if (status)
        return status;
    for (int i = 0; i < 3; i++)
        if (fabs(instrument->trocar_m[i]) + instrument->length_max_m > LARGEST_POSITION_m)
            return failure_set(why, STATUS_SCENE_VALUE, place, "move the mesh and the trocar near the origin",
                               "the tip of '%s' can come to %.3g m from the origin; the bus reports up to %.3g m",
                               instrument->name, fabs(instrument->trocar_m[i]) + instrument->length_max_m,
                               LARGEST_POSITION_m);
    struct seen nearest = {.distance_m = INFINITY};
    for (size_t t = 0; t < surface->triangle_count; t++) {
        double middle[3] = {0, 0, 0};
        for (int c = 0; c < 3; c++)
            for (int i = 0; i < 3; i++)
                middle[i] += mesh->nodes[3 * (size_t)surface->node[surface->triangles[3 * t + c]] + i] / 3;
        for (int c = 0; c < 4; c++) {
            const double *corner = &mesh->nodes[3 * (size_t)surface->node[surface->triangles[3 * t + c % 3]]];
            struct seen p = look(&tool, c == 3 ? middle : corner);
            if (touches(&tool, &p))
                return STATUS_OK;
            if (p.distance_m < nearest.distance_m)
                nearest = p;
        }
    }
    uint32_t hit;
    if (scene_ray(mesh, surface, instrument->trocar_m, instrument->axis, &hit) <= instrument->length_max_m)
        return STATUS_OK;
    return failure_set(
        why, STATUS_SCENE_VALUE, place, "move the trocar or turn its axis; or leave it out to have it placed",
        "'%s' reaches no point of the body: the nearest is %.3g m from the trocar and %.0f degrees off its "
        "axis, the tip goes to %.3g..%.3g m and %.0f degrees",
        instrument->name, nearest.distance_m, nearest.off_axis_rad * 180 / PI, instrument->length_min_m,
        instrument->length_max_m, tool.axis[0].maximum * 180 / PI);
}

int scene_check_reach(const struct scene *scene, const struct mesh *mesh, const struct surface *surface,
                      struct failure *why)
{
    const char *place = scene->path[0] ? scene->path : scene->mesh_path;
    for (size_t k = 0; k < scene->instrument_count; k++) {
        int status = check_one(&scene->instrument[k], mesh, surface, place, why);
        if (status)
            return status;
    }
    return STATUS_OK;
}
