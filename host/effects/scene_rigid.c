#include "scene_rigid.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "effects/convex.h"
#include "effects/image.h"
#include "scene_keys.h"

#define MOST_RADIUS_m 0.5

static double shaft_radius(const struct scene *scene, size_t instrument)
{
    const struct scene_shape *shape = &scene->effects.shape;
    bool shaped = (scene->effects.named & EFFECT_SHAPE) != 0 &&
                  (!*shape->instrument || !strcmp(shape->instrument, scene->instrument[instrument].name));
    double radius = scene->effects.rigid.shaft_radius_m;
    if (radius > 0)
        return radius;
    return shaped ? shape->shaft.radius_m : scene->instrument[instrument].tip_radius_m;
}

/* As the controller has it (firmware/effects/rigid.h). */
static double stop_at(const struct scene *scene, size_t instrument)
{
    double cannula = scene->effects.rigid.cannula_radius_m, tip = scene->instrument[instrument].tip_radius_m;
    return cannula > 0 && tip > cannula ? scene->effects.rigid.cannula_inside_m + sqrt(tip * tip - cannula * cannula)
                                        : 0;
}

unsigned scene_rigid_contacts(const struct scene *scene)
{
    unsigned most = scene->instrument_count == 2;
    for (size_t i = 0; i < scene->instrument_count; i++)
        most += (unsigned)scene->effects.rigid.obstacle_count + (stop_at(scene, i) > 0);
    return most;
}

unsigned scene_rigid_pairs(const struct scene *scene, unsigned *points)
{
    const struct scene_rigid *r = &scene->effects.rigid;
    unsigned pairs = 0, together = 1;
    *points = 0;
    for (size_t i = 0; i < scene->instrument_count; i++) {
        unsigned pieces = 1 + (r->cannula_radius_m > 0) + (scene->instrument[i].tip_radius_m > shaft_radius(scene, i));
        for (size_t k = 0; k < r->obstacle_count; k++)
            *points += pieces * (2 + (unsigned)r->obstacle[k].points);
        pairs += pieces * (unsigned)r->obstacle_count;
        together *= pieces;
    }
    if (scene->instrument_count == 1)
        return pairs;
    *points += 4 * together;
    return pairs + together;
}

/* An instrument as it is when it is drawn back, straight in its trocar: cannula, shaft and tip (firmware/effects/rigid.h). */
struct drawn {
    float point[3][2][3];
    double radius_m[3];
};

static void draw_back(const struct scene *scene, size_t i, struct drawn *d)
{
    const struct scene_instrument *own = &scene->instrument[i];
    const struct scene_rigid *r = &scene->effects.rigid;
    double end = own->length_min_m, inside = fmin(r->cannula_inside_m, end),
           at[3][2] = {{0, inside}, {inside, end}, {end, end}};
    for (int p = 0; p < 3; p++)
        for (int e = 0; e < 2; e++)
            for (int k = 0; k < 3; k++)
                d->point[p][e][k] = (float)(own->trocar_m[k] + at[p][e] * own->axis[k]);
    d->radius_m[0] = r->cannula_radius_m;
    d->radius_m[1] = shaft_radius(scene, i);
    d->radius_m[2] = own->tip_radius_m;
}

static struct convex hull_of(const struct scene_obstacle *obstacle, float point[BANK_MAX_OBSTACLE_POINTS][3])
{
    for (size_t i = 0; i < obstacle->points; i++)
        for (int k = 0; k < 3; k++)
            point[i][k] = (float)obstacle->point_m[i][k];
    return (struct convex){(const float(*)[3])point, (uint32_t)obstacle->points};
}

/* How deep it is in the rounded hull; below 0: how far away. */
static double depth_of(const struct drawn *d, struct convex hull, double radius_m)
{
    double deepest = -INFINITY;
    for (int p = 0; p < 3; p++) {
        struct convex_closest closest;
        convex_closest((struct convex){(const float(*)[3])d->point[p], 2}, hull, (const float[3]){0, 0, 1}, &closest);
        deepest = fmax(deepest, d->radius_m[p] + radius_m - (double)closest.distance_m);
    }
    return deepest;
}

/* Nothing may be inside anything when every instrument is drawn back. */
static int check_rest(const struct scene *scene, struct failure *why)
{
    const struct scene_rigid *r = &scene->effects.rigid;
    struct drawn drawn[BANK_MAX_INSTRUMENTS];
    for (size_t i = 0; i < scene->instrument_count; i++) {
        draw_back(scene, i, &drawn[i]);
        for (size_t k = 0; k < r->obstacle_count; k++) {
            float hull[BANK_MAX_OBSTACLE_POINTS][3];
            double depth = depth_of(&drawn[i], hull_of(&r->obstacle[k], hull), r->obstacle[k].radius_m);
            if (depth >= 0)
                return failure_at(why, STATUS_SCENE_VALUE, scene->path, r->obstacle[k].line, "move one of them",
                                  "'%s' is inside the obstacle '%s' when it is drawn back: by %.3g mm",
                                  scene->instrument[i].name, r->obstacle[k].name, 1000 * depth);
        }
        for (size_t j = 0; j < i; j++)
            for (int p = 0; p < 3; p++) {
                struct convex other = {(const float(*)[3])drawn[j].point[p], 2};
                double depth = depth_of(&drawn[i], other, drawn[j].radius_m[p]);
                if (depth >= 0)
                    return failure_set(why, STATUS_SCENE_VALUE, scene->path,
                                       "move their trocars apart or turn their axes",
                                       "'%s' and '%s' are inside each other when they are drawn back: by %.3g mm",
                                       scene->instrument[j].name, scene->instrument[i].name, 1000 * depth);
            }
    }
    return STATUS_OK;
}

static void obstacle(struct tree *t, tree_node map, struct scene_rigid *r)
{
    struct scene_obstacle *o = &r->obstacle[r->obstacle_count];
    if (!tree_map(t, map, "obstacle", KEYS("name", "hull", "radius")))
        return;
    o->line = tree_line(map);
    tree_name(t, tree_need(t, map, "obstacle", "name"), "name", o->name, sizeof o->name);
    tree_node hull = tree_need(t, map, "obstacle", "hull");
    o->points = tree_list(t, hull, "hull", BANK_MAX_OBSTACLE_POINTS);
    tree_require(t, hull, o->points > 0, "hull is empty: give 1 to %d points", BANK_MAX_OBSTACLE_POINTS);
    for (size_t i = 0; i < o->points; i++)
        scene_position(t, tree_item(t, hull, i), "a point of hull", o->point_m[i]);
    scene_bounded(t, tree_find(t, map, "radius"), "radius", DIMENSION_LENGTH, 0, MOST_RADIUS_m, " m", &o->radius_m);
    for (size_t i = 0; i < r->obstacle_count; i++)
        tree_require(t, map, strcmp(o->name, r->obstacle[i].name) != 0, "two obstacles are named '%s'", o->name);
    r->obstacle_count++;
}

static void cannula(struct tree *t, tree_node map, struct scene_rigid *r)
{
    if (!map || !tree_map(t, map, "cannula", KEYS("radius", "inside")))
        return;
    scene_bounded(t, tree_need(t, map, "cannula", "radius"), "radius", DIMENSION_LENGTH, (double)BANK_MIN_SHAFT_M,
                  MOST_RADIUS_m, " m", &r->cannula_radius_m);
    scene_bounded(t, tree_need(t, map, "cannula", "inside"), "inside", DIMENSION_LENGTH, 0, 1, " m",
                  &r->cannula_inside_m);
}

void scene_rigid_parse(struct tree *t, void *map, struct scene *scene)
{
    struct scene_rigid *r = &scene->effects.rigid;
    *r = (struct scene_rigid){.obstacle_count = 0};
    if (tree_empty(t, map) || !tree_map(t, map, "rigid", KEYS("shaft", "cannula", "obstacles")))
        return;
    scene_bounded(t, tree_find(t, map, "shaft"), "shaft", DIMENSION_LENGTH, (double)BANK_MIN_SHAFT_M,
                  SCENE_MAX_TIP_RADIUS_m, " m", &r->shaft_radius_m);
    cannula(t, tree_find(t, map, "cannula"), r);
    tree_node list = tree_find(t, map, "obstacles");
    size_t count = tree_list(t, list, "obstacles", BANK_MAX_OBSTACLES);
    for (size_t i = 0; i < count; i++)
        obstacle(t, tree_item(t, list, i), r);
}

static void check_instrument(struct tree *t, tree_node map, const struct scene *scene, size_t i)
{
    const struct scene_rigid *r = &scene->effects.rigid;
    const struct scene_instrument *own = &scene->instrument[i];
    double shaft = shaft_radius(scene, i), used = fmax(r->cannula_inside_m, stop_at(scene, i));
    tree_require(t, map, shaft >= (double)BANK_MIN_SHAFT_M,
                 "the shaft of '%s' is as thin as its tip, %.3g mm: give shaft, %.3g mm or more", own->name,
                 1000 * shaft, 1000 * (double)BANK_MIN_SHAFT_M);
    tree_require(t, map, r->cannula_radius_m == 0 || r->cannula_radius_m >= shaft,
                 "a cannula of %.4g mm does not hold the shaft of '%s', %.4g mm", 1000 * r->cannula_radius_m, own->name,
                 1000 * shaft);
    tree_require(t, map, used < own->length_max_m,
                 "a cannula that ends %.4g m inside leaves nothing of the %.4g m of '%s'", used, own->length_max_m,
                 own->name);
}

void scene_rigid_check(struct tree *t, void *map, const struct scene *scene)
{
    unsigned points = 0, most = scene_rigid_contacts(scene);
    bool placed = true;
    for (size_t i = 0; i < scene->instrument_count; i++) {
        points += scene->instrument[i].tip_points;
        placed = placed && scene->instrument[i].placed;
        check_instrument(t, map, scene, i);
    }
    tree_require(t, map, most > 0, "rigid has nothing to touch: name obstacles, or write a second instrument");
    tree_require(t, map, points + most <= BANK_MAX_TOOL_POINTS,
                 "%u points of the tips and %u rigid contacts: %d in all fit one contact system; give the tips fewer "
                 "points or name fewer obstacles",
                 points, most, BANK_MAX_TOOL_POINTS);
    if (!t->status && placed)
        t->status = check_rest(scene, t->why);
}

static void print_obstacle(FILE *out, const struct scene_obstacle *o)
{
    char text[QUANTITY_TEXT];
    fprintf(out, "{name: %s, hull: [", o->name);
    for (size_t p = 0; p < o->points; p++)
        for (int k = 0; k < 3; k++) {
            quantity_print(o->point_m[p][k], DIMENSION_POSITION, text);
            fprintf(out, "%s%s%s", k ? ", " : p ? ", [" : "[", text, k == 2 ? "]" : "");
        }
    quantity_print(o->radius_m, DIMENSION_LENGTH, text);
    fprintf(out, "], radius: %s}", text);
}

void scene_rigid_print(FILE *out, const struct scene *scene)
{
    const struct scene_rigid *r = &scene->effects.rigid;
    char text[QUANTITY_TEXT], inside[QUANTITY_TEXT];
    fprintf(out, "{obstacles: [");
    for (size_t i = 0; i < r->obstacle_count; i++) {
        fprintf(out, "%s", i ? ", " : "");
        print_obstacle(out, &r->obstacle[i]);
    }
    fputc(']', out);
    quantity_print(r->shaft_radius_m, DIMENSION_LENGTH, text);
    if (r->shaft_radius_m > 0)
        fprintf(out, ", shaft: %s", text);
    quantity_print(r->cannula_radius_m, DIMENSION_LENGTH, text);
    quantity_print(r->cannula_inside_m, DIMENSION_LENGTH, inside);
    if (r->cannula_radius_m > 0)
        fprintf(out, ", cannula: {radius: %s, inside: %s}", text, inside);
    fputc('}', out);
}

int scene_rigid_section(const struct scene *scene, struct body *body, struct effect_section *section,
                        struct failure *why)
{
    (void)body;
    const struct scene_rigid *r = &scene->effects.rigid;
    int status = check_rest(scene, why);
    if (status)
        return status;
    section->count = r->obstacle_count;
    section->length = sizeof(struct bank_rigid) + r->obstacle_count * sizeof(struct bank_obstacle);
    struct bank_rigid *b = section->bytes = calloc(1, section->length);
    if (!b)
        return failure_set(why, STATUS_MEMORY, scene->path, NULL, "no memory for the effect rigid");
    struct bank_obstacle *to = (void *)(b + 1);
    b->obstacles = (uint32_t)r->obstacle_count;
    b->cannula_radius_m = (float)r->cannula_radius_m;
    b->cannula_inside_m = (float)r->cannula_inside_m;
    for (size_t t = 0; t < BANK_MAX_INSTRUMENTS; t++)
        b->shaft_radius_m[t] = (float)shaft_radius(scene, t < scene->instrument_count ? t : 0);
    for (size_t i = 0; i < r->obstacle_count; i++) {
        to[i].radius_m = (float)r->obstacle[i].radius_m;
        to[i].points = (uint32_t)r->obstacle[i].points;
        for (size_t p = 0; p < r->obstacle[i].points; p++)
            for (int k = 0; k < 3; k++)
                to[i].point_m[p][k] = (float)r->obstacle[i].point_m[p][k];
    }
    return STATUS_OK;
}
