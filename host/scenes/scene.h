/* A scene: body, instruments, effects, budgets, read from one YAML file. SI units in memory. Every value of the file
 * has its unit written behind it; unknown keys, missing units and impossible values are errors with the file's line.
 * SCENE.md lists every key with its unit, default and range. */
#ifndef TROCAR_SCENE_H
#define TROCAR_SCENE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "bank_format.h"
#include "effects.h"
#include "failure.h"
#include "mesh.h"

struct device_model;

enum { SCENE_MAX_MATERIALS = 32, SCENE_MAX_FIXED = 16, SCENE_MAX_LIGAMENTS = 16 };

#define SCENE_DEFAULT_DEVICE         "impulse-engine"
#define SCENE_DEFAULT_TIP_RADIUS_m   0.005
#define SCENE_MAX_TIP_RADIUS_m       0.1
#define SCENE_DEFAULT_TIP_POINTS     7
#define SCENE_DEFAULT_REGULARISATION 1e-3
#define SCENE_MIN_REGULARISATION     1e-5 /* below it single precision loses definiteness */

/* Order of the shape functions. Linear elements are too stiff, by 40 % at nu = 0.45 and without bound towards 0.5; the
 * controller never sees the difference in work. */
enum element_order { ELEMENT_LINEAR, ELEMENT_QUADRATIC };
#define SCENE_DEFAULT_ORDER ELEMENT_QUADRATIC

enum selection_kind {
    SELECT_BOX,    /* a = lower corner, b = upper corner, m */
    SELECT_SPHERE, /* a = centre, value = radius, m */
    SELECT_PLANE,  /* the side n.(x - a) >= 0 of the plane through a with normal b */
    SELECT_LABEL,  /* nodes of elements with this label */
    SELECT_PATCH,  /* the share `value` (0..1) of the surface vertices nearest to point a, connected or not: rounded up
                      to whole vertices; equally near ones in vertex order */
    SELECT_AXIS_END, /* the share `value` of the surface vertices at the lower end of the longest axis, rounded up, with
                        all that lie as far out as the last of them (1e-6 of the axis): a flat end goes as a whole */
};

struct selection {
    enum selection_kind kind;
    double a[3], b[3], value;
    char label[64];
    long line; /* of the scene file, 0 when assumed */
};

enum symmetry { SYMMETRY_ISOTROPIC, SYMMETRY_TRANSVERSE, SYMMETRY_ORTHOTROPIC };

/* Engineering constants along the axes 1, 2, 3 of symmetry; pairs in the order 12, 13, 23. hooke.h says what each means. */
struct scene_orthotropic {
    double E_Pa[3], nu[3], G_Pa[3];
};

struct scene_material {
    char label[64]; /* "all", a name, or a number as text; a specific label wins over all */
    enum symmetry symmetry;
    double E_Pa, nu;                      /* when isotropic */
    struct scene_orthotropic orthotropic; /* when not; transverse: L = 1, T = 2 and 3 */
    double along[3], across[3];           /* unit vectors along the axes 1 and, orthotropic only, 2 */
    char along_array[64];                 /* node data of the mesh that has `along`, "" when it is given */
    bool by_intensity;                    /* only elements whose mean intensity is in [low, high) */
    double intensity[2];
    double rho_kg_m3;
    long line;
};

struct scene_fixed {
    struct selection where;
    bool component[3]; /* which components are fixed: all three by default; none with `slides` */
    bool slides;       /* only what moves along this direction is fixed */
    double along[3];   /* unit vector, oblique: a direction of an axis is a component */
};

struct scene_ligament {
    struct selection where; /* the spring's stiffness is spread over the selected surface triangles by area */
    double stiffness_N_m;
    double direction[3]; /* unit vector */
};

struct scene_instrument {
    char name[32];
    bool placed;                 /* trocar given; otherwise it is placed above the body by scene_place_instrument */
    double trocar_m[3], axis[3]; /* fixed point; unit vector into the body */
    double length_min_m, length_max_m;
    double tip_radius_m;
    unsigned tip_points; /* 1 .. BANK_MAX_TOOL_POINTS */
    char device[32];
    double coupling_stiffness_N_m, coupling_damping_Ns_m; /* 0: default from the device */
    double force_limit_N;                                 /* 0: the device's */
};

struct scene {
    char path[1024]; /* "" when assumed */
    char name[64];
    char mesh_path[1024]; /* resolved relative to the scene's folder */
    double extent_m;      /* > 0, or unit */
    enum mesh_unit unit;
    double surface_size_m; /* element size when the mesh is a surface; 0: keep */
    enum element_order order;
    bool allow_components;
    char intensity_array[64];  /* node data by which materials are told apart; "" when none */
    char intensity_path[1024]; /* CSV file that has it, "" when the mesh does; resolved as mesh_path is */
    long intensity_line;
    size_t material_count, fixed_count, ligament_count, instrument_count;
    struct scene_material material[SCENE_MAX_MATERIALS];
    struct scene_fixed fixed[SCENE_MAX_FIXED];
    struct scene_ligament ligament[SCENE_MAX_LIGAMENTS];
    struct scene_instrument instrument[BANK_MAX_INSTRUMENTS];
    double regularisation; /* epsilon as a fraction of the median compliance; default 1e-3 */
    unsigned solver_steps; /* 1 .. BANK_MAX_SOLVER_STEPS; 0: no bound of the scene's */
    struct scene_effects effects;
    double budget_instructions, budget_bank_bytes, budget_force_error; /* 0: none */
};

/* Read and check a scene file. */
int scene_read(const char *path, struct scene *scene, struct failure *why);
/* The same from text; `path` names it in messages and anchors relative mesh paths. */
int scene_parse(const char *text, size_t length, const char *path, struct scene *scene, struct failure *why);

/* Place-less instrument "right" with every default: what a file without `instruments` means. */
void scene_assume_instrument(struct scene_instrument *instrument);

/* The scene that `trocar build MESH` assumes: E = 4 kPa, nu = 0.45, rho = 1060 kg/m3, the 4 % of the surface vertices
 * at the end of the longest axis fixed, one instrument "right" above the middle. */
void scene_assume(const char *mesh_path, double extent_m, enum mesh_unit unit, struct scene *scene);

/* The scene as YAML that scene_parse reads back to the same scene, but for lines and path (malloc; NULL without
 * memory). The mesh path is printed as it is in memory: relative to the working directory, not to a scene file. */
char *scene_print(const struct scene *scene);

/* Place instruments that the scene does not place: at free tissue away from fixed vertices, as near to the body's
 * middle and as square to its shortest axis as that allows, pointing along the inward normal averaged around the touch
 * point. The trocar stands back so far that the insertion range holds 30 mm of approach and 40 mm of depth (0.16 m for
 * 0.10..0.23 m; a shorter range is shared 3 : 4). Two instruments touch at least 15 % of the extent apart where they
 * can. `fixed_vertex` has one flag per vertex. Bounded: 1024 candidate triangles, one ray through the surface each. */
void scene_place_instruments(struct scene *scene, const struct mesh *mesh, const struct surface *surface,
                             const bool *fixed_vertex);

/* Refuse an instrument that can touch no point of the body, whatever the hand does, or whose tip can leave the range that
 * the bus reports: STATUS_SCENE_VALUE. All instruments must be placed. */
int scene_check_reach(const struct scene *scene, const struct mesh *mesh, const struct surface *surface,
                      struct failure *why);

/* Where a ray from `origin` along the unit vector `direction` first enters the surface: the distance, and the triangle;
 * INFINITY when it misses. */
double scene_ray(const struct mesh *mesh, const struct surface *surface, const double origin[3],
                 const double direction[3], uint32_t *triangle);

/* Nodes of a selection: overwrites inside[node] for all node_count nodes, true for those selected: surface vertices for
 * every kind, for BOX, SPHERE, PLANE and LABEL interior nodes too (boundaries belong to the selection). `count`: how
 * many. An empty selection is STATUS_SCENE_SELECTION. */
int scene_select(const struct selection *selection, const struct scene *scene, const struct mesh *mesh,
                 const struct surface *surface, bool *inside, size_t *count, struct failure *why);

/* The mesh of a scene with the node data that its materials need: mesh_read_data. `size` is in file units. */
int scene_mesh(const struct scene *scene, double size, struct mesh *mesh, struct failure *why);

/* Intensities from the scene's CSV file, if it names one, into the node data of a mesh that is checked and not yet scaled.
 * Columns x, y, z (in the units of the mesh file) and one with the array's name; a row belongs to the node that stands at
 * its place, to 1e-5 of the extent. Rows for no node are ignored. */
int scene_intensities(const struct scene *scene, struct mesh *mesh, struct failure *why);

/* Materials by element: index into scene->material, one per tetrahedron (caller's array). A material's label is a
 * label's name or number; a specific one wins over "all", and among those with the same label one with a range that holds
 * the mean of the intensities at the element's four vertices wins over one without. Elements without a material are
 * STATUS_MODEL_LABEL; a material whose label the mesh lacks, or two materials for one element, STATUS_SCENE_VALUE; a vertex
 * without intensity STATUS_MODEL_DATA. */
int scene_materials(const struct scene *scene, const struct mesh *mesh, uint8_t *material_of, struct failure *why);

/* The virtual coupling of an instrument at its device. Passive at T = 1 ms while K <= min(2 (b - B)/T, 2 f_c/D)
 * (Colgate and Schenkel; Abbott and Okamura), with the device's viscous friction b, Coulomb friction f_c and resolution
 * D at the tip, worst over the three axes at the largest insertion. Defaults: B = b/5, and K = half the bound, because
 * the motors answer up to one tick after the sample. impulse-engine to 0.23 m: b = 1.5 N s/m, B = 0.3 N s/m, bound 2400
 * N/m, K = 1200 N/m. */
struct scene_coupling {
    double stiffness_N_m, damping_Ns_m;                /* K, B: the scene's or the defaults */
    double device_damping_Ns_m, largest_stiffness_N_m; /* b, the bound for this B */
};
void scene_coupling(const struct scene_instrument *instrument, const struct device_model *device,
                    struct scene_coupling *coupling);

/* The bank's records that follow from an instrument and its device. The trocar's frame: Z the axis; X the world's x
 * (its y when Z is within 26 degrees of x) made square to Z; Y = Z x X. The device's weight acts along Z at rest (it
 * stands upright). Points: number 0 is the tip itself; the others lie on the sphere of the tip's radius that has the
 * tip as its apex, up to 7 points on one ring 45 degrees from the apex, from 8 a third of them on a ring at 30 and the
 * rest at 60 degrees. The instrument must be placed. */
int scene_tool(const struct scene_instrument *instrument, struct bank_tool *tool, struct failure *why);

/* How contact is rendered: epsilon = regularisation times the median compliance; of the instruments the softest
 * coupling and the lowest force limit; full force within 5 ms; decay in 20 ms. */
void scene_contact(const struct scene *scene, double median_compliance_m_N, struct bank_contact *contact);

#endif
