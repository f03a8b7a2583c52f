/* A scene: body, instruments, effects, budgets, read from one YAML file. SI units in memory. Every value of the file has
 * its unit written behind it; unknown keys, missing units and impossible values are errors with the file's line. */
#ifndef TROCAR_SCENE_H
#define TROCAR_SCENE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "bank_format.h"
#include "failure.h"
#include "mesh.h"

enum { SCENE_MAX_MATERIALS = 32, SCENE_MAX_FIXED = 16, SCENE_MAX_LIGAMENTS = 16 };

enum selection_kind {
    SELECT_BOX,      /* a = lower corner, b = upper corner, m */
    SELECT_SPHERE,   /* a = centre, value = radius, m */
    SELECT_PLANE,    /* the side n.(x - a) >= 0 of the plane through a with normal b */
    SELECT_LABEL,    /* nodes of elements with this label */
    SELECT_PATCH,    /* the share `value` (0..1) of the surface vertices nearest to point a, connected or not */
    SELECT_AXIS_END, /* the share `value` of the surface vertices at the end of the longest axis (lower end) */
};

struct selection {
    enum selection_kind kind;
    double a[3], b[3], value;
    char label[64];
    long line; /* of the scene file, 0 when assumed */
};

struct scene_material {
    char label[64]; /* "all", a name, or a number as text; a specific label wins over all */
    double E_Pa, nu, rho_kg_m3;
    long line;
};

struct scene_fixed {
    struct selection where;
    bool component[3]; /* which components are fixed: all three by default */
};

struct scene_ligament {
    struct selection where; /* the spring's stiffness is shared equally by the selected surface vertices */
    double stiffness_N_m;
    double direction[3]; /* unit vector */
};

struct scene_instrument {
    char name[32];
    bool placed;              /* trocar given; otherwise it is placed above the body by scene_place_instrument */
    double trocar_m[3], axis[3]; /* fixed point; unit vector into the body */
    double length_min_m, length_max_m;
    double tip_radius_m;
    unsigned tip_points;      /* 1 .. BANK_MAX_TOOL_POINTS */
    char device[32];
    double coupling_stiffness_N_m, coupling_damping_Ns_m; /* 0: default from the device */
    double force_limit_N;     /* 0: the device's */
};

struct scene {
    char path[1024];   /* "" when assumed */
    char name[64];
    char mesh_path[1024]; /* resolved relative to the scene's folder */
    double extent_m;      /* > 0, or unit */
    enum mesh_unit unit;
    double surface_size_m; /* element size when the mesh is a surface; 0: keep */
    bool allow_components;
    size_t material_count, fixed_count, ligament_count, instrument_count;
    struct scene_material material[SCENE_MAX_MATERIALS];
    struct scene_fixed fixed[SCENE_MAX_FIXED];
    struct scene_ligament ligament[SCENE_MAX_LIGAMENTS];
    struct scene_instrument instrument[BANK_MAX_INSTRUMENTS];
    double regularisation; /* epsilon as a fraction of the median compliance; default 1e-3 */
    double budget_instructions, budget_bank_bytes, budget_force_error; /* 0: none */
};

/* Read and check a scene file. */
int scene_read(const char *path, struct scene *scene, struct failure *why);
/* The same from text; `path` names it in messages and anchors relative mesh paths. */
int scene_parse(const char *text, size_t length, const char *path, struct scene *scene, struct failure *why);

/* The scene that `trocar build MESH` assumes: E = 4 kPa, nu = 0.45, rho = 1060 kg/m3, the 4 % of the surface vertices at
 * the end of the longest axis fixed, one instrument "right" above the middle. */
void scene_assume(const char *mesh_path, double extent_m, enum mesh_unit unit, struct scene *scene);

/* The scene as YAML that scene_read reads back to the same scene (malloc). */
char *scene_print(const struct scene *scene);

/* Place instruments that the scene does not place: the trocar 0.12 m above the free part's surface along the shortest axis
 * of the bounding box, pointing at it, touching ground away from fixed vertices. `fixed_vertex` has one flag per vertex. */
void scene_place_instruments(struct scene *scene, const struct mesh *mesh, const struct surface *surface,
                             const bool *fixed_vertex);

/* Nodes of a selection: sets inside[node] for surface vertices (and for BOX, SPHERE, PLANE, LABEL for interior nodes too)
 * and returns how many; an empty selection is STATUS_SCENE_SELECTION. */
int scene_select(const struct selection *selection, const struct scene *scene, const struct mesh *mesh,
                 const struct surface *surface, bool *inside, size_t *count, struct failure *why);

/* Materials by element: index into scene->material, one per tetrahedron (caller's array). */
int scene_materials(const struct scene *scene, const struct mesh *mesh, uint8_t *material_of, struct failure *why);

/* The bank's records that follow from an instrument and its device. */
int scene_tool(const struct scene_instrument *instrument, struct bank_tool *tool, struct failure *why);
void scene_contact(const struct scene *scene, double median_compliance_m_N, struct bank_contact *contact);

#endif
