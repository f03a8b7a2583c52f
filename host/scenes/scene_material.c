/* The key `materials` of a body. */
#include <math.h>
#include <string.h>

#include "scene_keys.h"

static void modulus(struct tree *t, tree_node node, const char *name, double *value)
{
    scene_bounded(t, node, name, DIMENSION_PRESSURE, 1e-3, 1e13, " Pa", value);
}

/* The same material in every direction across its fibres. */
static void transverse(struct tree *t, tree_node map, struct scene_material *m)
{
    struct scene_orthotropic *o = &m->orthotropic;
    if (!tree_map(t, map, "transverse", KEYS("E_L", "E_T", "G_LT", "nu_LT", "nu_TT")))
        return;
    tree_node nu_TT = tree_need(t, map, "transverse", "nu_TT");
    modulus(t, tree_need(t, map, "transverse", "E_L"), "E_L", &o->E_Pa[0]);
    modulus(t, tree_need(t, map, "transverse", "E_T"), "E_T", &o->E_Pa[1]);
    modulus(t, tree_need(t, map, "transverse", "G_LT"), "G_LT", &o->G_Pa[0]);
    tree_quantity(t, tree_need(t, map, "transverse", "nu_LT"), "nu_LT", DIMENSION_NUMBER, &o->nu[0]);
    tree_quantity(t, nu_TT, "nu_TT", DIMENSION_NUMBER, &o->nu[2]);
    tree_require(t, nu_TT, o->nu[2] > -1 && o->nu[2] < 1, "nu_TT = %.9g: it must be above -1 and below 1", o->nu[2]);
    o->E_Pa[2] = o->E_Pa[1];
    o->nu[1] = o->nu[0];
    o->G_Pa[1] = o->G_Pa[0];
    o->G_Pa[2] = o->E_Pa[1] / (2 * (1 + o->nu[2]));
}

static void orthotropic(struct tree *t, tree_node map, struct scene_material *m)
{
    struct scene_orthotropic *o = &m->orthotropic;
    if (!tree_map(t, map, "orthotropic", KEYS("E", "G", "nu")))
        return;
    tree_node E = tree_need(t, map, "orthotropic", "E"), G = tree_need(t, map, "orthotropic", "G");
    tree_vector(t, E, "E", DIMENSION_PRESSURE, o->E_Pa);
    tree_vector(t, G, "G", DIMENSION_PRESSURE, o->G_Pa);
    for (int k = 0; k < 3; k++) {
        tree_require(t, E, o->E_Pa[k] >= 1e-3 && o->E_Pa[k] <= 1e13, "E: %g Pa must be from 0.001 to 1e13 Pa",
                     o->E_Pa[k]);
        tree_require(t, G, o->G_Pa[k] >= 1e-3 && o->G_Pa[k] <= 1e13, "G: %g Pa must be from 0.001 to 1e13 Pa",
                     o->G_Pa[k]);
    }
    tree_vector(t, tree_need(t, map, "orthotropic", "nu"), "nu", DIMENSION_NUMBER, o->nu);
}

/* Directions of an anisotropic material: `along`, and for an orthotropic one `across`. */
static void directions(struct tree *t, tree_node map, struct scene_material *m)
{
    tree_node across = tree_find(t, map, "across");
    tree_node along = tree_need(t, map, "material", "along");
    if (along && along->type == YAML_MAPPING_NODE) {
        if (tree_map(t, along, "along", KEYS("array")))
            tree_text(t, tree_need(t, along, "along", "array"), "array", m->along_array, sizeof m->along_array);
    } else {
        tree_direction(t, along, "along", m->along);
    }
    if (m->symmetry != SYMMETRY_ORTHOTROPIC) {
        if (across)
            tree_fail(t, across, STATUS_SCENE_KEY, "remove it", "across belongs to orthotropic materials");
        return;
    }
    tree_direction(t, tree_need(t, map, "material", "across"), "across", m->across);
    double cosine = m->along[0] * m->across[0] + m->along[1] * m->across[1] + m->along[2] * m->across[2];
    tree_require(t, across,
                 *m->along_array ||
                     fabs(cosine) < 0.0175, /* 1 degree: decimals of a direction, not another direction */
                 "along and across are %.1f degrees apart: they must be square", acos(cosine) * 180 / M_PI);
}

static void elasticity(struct tree *t, tree_node map, struct scene_material *m)
{
    tree_node fibres = tree_find(t, map, "transverse"), three = tree_find(t, map, "orthotropic");
    tree_node E = tree_find(t, map, "E"), nu = tree_find(t, map, "nu");
    int laws = (fibres != NULL) + (three != NULL) + (E || nu);
    if (laws > 1) {
        tree_fail(t, map, STATUS_SCENE_VALUE, "keep one of them",
                  "the material has two laws: give E and nu, or transverse, or orthotropic");
        return;
    }
    if (fibres || three) {
        m->symmetry = fibres ? SYMMETRY_TRANSVERSE : SYMMETRY_ORTHOTROPIC;
        if (fibres)
            transverse(t, fibres, m);
        else
            orthotropic(t, three, m);
        directions(t, map, m);
        return;
    }
    E = tree_need(t, map, "material", "E");
    nu = tree_need(t, map, "material", "nu");
    modulus(t, E, "E", &m->E_Pa);
    tree_quantity(t, nu, "nu", DIMENSION_NUMBER, &m->nu);
    tree_require(t, nu, m->nu > -1 && m->nu < 0.5, "nu = %.9g: it must be above -1 and below 0.5", m->nu);
    static const char *const needless[] = {"along", "across"};
    for (int k = 0; k < 2; k++) {
        tree_node node = tree_find(t, map, needless[k]);
        if (node)
            tree_fail(t, node, STATUS_SCENE_KEY, "remove it, or give transverse or orthotropic constants",
                      "%s belongs to materials with directions; this one has E and nu", needless[k]);
    }
}

void scene_intensity_source(struct tree *t, tree_node map, struct scene *scene)
{
    if (!map || !tree_map(t, map, "intensities", KEYS("array", "file")))
        return;
    tree_node file = tree_find(t, map, "file");
    scene->intensity_line = tree_line(map);
    tree_text(t, tree_need(t, map, "intensities", "array"), "array", scene->intensity_array,
              sizeof scene->intensity_array);
    if (file)
        scene_file(t, file, scene->intensity_path, sizeof scene->intensity_path);
}

static void intensity(struct tree *t, tree_node node, const struct scene *scene, struct scene_material *m)
{
    if (!node)
        return;
    if (!*scene->intensity_array)
        tree_fail(t, node, STATUS_SCENE_MISSING, "add intensities: {array: NAME} to the body",
                  "a material has an intensity, but the body has no intensities");
    m->by_intensity = true;
    tree_range(t, node, "intensity", DIMENSION_NUMBER, m->intensity);
    tree_require(t, node, m->intensity[0] < m->intensity[1], "intensity = %g..%g: the first must be below the second",
                 m->intensity[0], m->intensity[1]);
}

/* Both may be the material of one element. */
static bool collide(const struct scene_material *a, const struct scene_material *b)
{
    if (strcmp(a->label, b->label) != 0 || a->by_intensity != b->by_intensity)
        return false;
    return !a->by_intensity || (a->intensity[0] < b->intensity[1] && b->intensity[0] < a->intensity[1]);
}

void scene_material_list(struct tree *t, tree_node list, struct scene *scene)
{
    size_t count = tree_list(t, list, "materials", SCENE_MAX_MATERIALS);
    tree_require(t, list, count > 0, "materials is empty");
    for (size_t i = 0; i < count; i++) {
        tree_node map = tree_item(t, list, i);
        if (!tree_map(t, map, "material",
                      KEYS("label", "intensity", "E", "nu", "transverse", "orthotropic", "along", "across", "rho")))
            return;
        struct scene_material *m = &scene->material[i];
        *m = (struct scene_material){.label = "all", .line = tree_line(map)};
        tree_text(t, tree_find(t, map, "label"), "label", m->label, sizeof m->label);
        intensity(t, tree_find(t, map, "intensity"), scene, m);
        elasticity(t, map, m);
        scene_bounded(t, tree_need(t, map, "material", "rho"), "rho", DIMENSION_DENSITY, 1e-3, 1e5, " kg/m3",
                      &m->rho_kg_m3);
        for (size_t j = 0; j < i; j++)
            tree_require(t, map, !collide(m, &scene->material[j]), "label '%s' has a material already%s, in line %ld",
                         m->label, m->by_intensity ? " for a part of these intensities" : "", scene->material[j].line);
    }
    scene->material_count = count;
}
