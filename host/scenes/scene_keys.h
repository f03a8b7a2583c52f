/* How keys of a scene are read: shared by the scene_*.c that turn one part of the file into struct scene. */
#ifndef TROCAR_SCENE_KEYS_H
#define TROCAR_SCENE_KEYS_H

#include "scene.h"
#include "tree.h"

#define KEYS(...)                                                                                                      \
    (const char *const[])                                                                                              \
    {                                                                                                                  \
        __VA_ARGS__, NULL                                                                                              \
    }

/* Wide bounds, to keep mistakes of units and numbers that overflow a float out. */
#define SCENE_MIN_LENGTH_m 1e-5
#define SCENE_MAX_LENGTH_m 1e3

/* A value from `low` to `high`; `shown` is the unit of the message. */
void scene_bounded(struct tree *t, tree_node node, const char *name, enum dimension dimension, double low, double high,
                   const char *shown, double *value);
/* A position in the mesh's frame, within what a bank holds. */
void scene_position(struct tree *t, tree_node node, const char *name, double at[3]);
/* `body`: mesh, fixed, ligaments (scene_body.c) and materials (scene_material.c). */
void scene_body(struct tree *t, tree_node map, struct scene *scene);
/* A path of the scene, relative to its folder, into `path`. */
void scene_file(struct tree *t, tree_node node, char *path, size_t size);
void scene_material_list(struct tree *t, tree_node list, struct scene *scene);
void scene_intensity_source(struct tree *t, tree_node map, struct scene *scene);

/* The scene's path for messages; labels of a mesh by name or number, and as a list ("3 'tumour', 4"). */
const char *scene_place(const struct scene *scene);
bool scene_label_matches(const struct mesh_label *label, const char *text);
void scene_list_labels(const struct mesh *mesh, char *text, size_t size);

#endif
