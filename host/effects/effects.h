/* The effects as the host sees them: what a scene says of each, and the section of the bank that follows. One row per effect
 * of shared/effects.def; an effect NAME supplies scene_NAME.h, with struct scene_NAME (what its key holds; in struct scene)
 * and the functions of struct effect below. */
#ifndef TROCAR_HOST_EFFECTS_H
#define TROCAR_HOST_EFFECTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "scene_friction.h"
#include "scene_grasp.h"
#include "scene_neo_hookean.h"
#include "scene_quasi_nonlinear.h"
#include "scene_second.h"
#include "scene_shape.h"
#include "scene_rigid.h"
#include "scene_swing.h"
#include "scene_viscoelastic.h"

struct body;
struct failure;
struct scene;
struct tree;

/* What a scene names, and its parameters. */
struct scene_effects {
    uint32_t named; /* EFFECT_NAME bits of firmware/effects/image.h */
#define EFFECT(bit, NAME, name, tag, parts, what) struct scene_##name name;
#include "effects.def"
#undef EFFECT
};

/* The bytes of a section. */
struct effect_section {
    void *bytes; /* malloc; the caller frees */
    size_t length, count;
};

struct effect {
    const char *name, *what;
    uint32_t bit, tag;
    /* The mapping behind its key; complains in the tree. `second` has no key: scene_parse names it. */
    void (*parse)(struct tree *tree, void *map, struct scene *scene);
    /* "{key: value, ...}", which parse reads back to the same. */
    void (*print)(FILE *out, const struct scene *scene);
    /* Its section of the bank, from a scene that names it and the body that the scene describes. */
    int (*section)(const struct scene *scene, struct body *body, struct effect_section *section, struct failure *why);
};

size_t effects_count(void);
const struct effect *effects_at(size_t index);
const struct effect *effects_find(const char *name); /* NULL: not known */

/* "friction, grasping" of the bits set, with this between; "none" when there is none. Bits without a name as "bit 7". */
void effects_names(uint32_t bits, const char *between, char *text, size_t room);

#endif
