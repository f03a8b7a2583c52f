/* Which effects this image has. The one place with a condition of the preprocessor: elsewhere IF_NAME(...) is its argument
 * in an image that has the effect and nothing in one that has not, so that what a scene does not name costs no byte and no
 * instruction.
 *
 * An image is compiled with TROCAR_IMAGE and TROCAR_HAS_name for each effect of its scene (Makefile: EFFECTS). Without
 * TROCAR_IMAGE, that is in the host tool and in tests, every effect is there. */
#ifndef TROCAR_EFFECTS_IMAGE_H
#define TROCAR_EFFECTS_IMAGE_H

#include <stdint.h>

#if !defined(TROCAR_IMAGE) || defined(TROCAR_HAS_friction)
#define IF_FRICTION(...) __VA_ARGS__
#else
#define IF_FRICTION(...)
#endif

#if !defined(TROCAR_IMAGE) || defined(TROCAR_HAS_grasp)
#define IF_GRASP(...) __VA_ARGS__
#else
#define IF_GRASP(...)
#endif

#if !defined(TROCAR_IMAGE) || defined(TROCAR_HAS_neo_hookean)
#define IF_NEO_HOOKEAN(...) __VA_ARGS__
#else
#define IF_NEO_HOOKEAN(...)
#endif

#if !defined(TROCAR_IMAGE) || defined(TROCAR_HAS_quasi_nonlinear)
#define IF_QUASI_NONLINEAR(...) __VA_ARGS__
#else
#define IF_QUASI_NONLINEAR(...)
#endif

#if !defined(TROCAR_IMAGE) || defined(TROCAR_HAS_second)
#define IF_SECOND(...) __VA_ARGS__
#else
#define IF_SECOND(...)
#endif

#if !defined(TROCAR_IMAGE) || defined(TROCAR_HAS_shape)
#define IF_SHAPE(...) __VA_ARGS__
#else
#define IF_SHAPE(...)
#endif

#if !defined(TROCAR_IMAGE) || defined(TROCAR_HAS_rigid)
#define IF_RIGID(...) __VA_ARGS__
#else
#define IF_RIGID(...)
#endif

#if !defined(TROCAR_IMAGE) || defined(TROCAR_HAS_swing)
#define IF_SWING(...) __VA_ARGS__
#else
#define IF_SWING(...)
#endif

#if !defined(TROCAR_IMAGE) || defined(TROCAR_HAS_viscoelastic)
#define IF_VISCOELASTIC(...) __VA_ARGS__
#else
#define IF_VISCOELASTIC(...)
#endif

/* The solver that friction and grasping share. */
#if IF_FRICTION(1) IF_GRASP(+1) + 0
#define IF_CONE(...) __VA_ARGS__
#else
#define IF_CONE(...)
#endif

/* Contacts that act elsewhere than at the tip have a lever of their own. */
#if IF_RIGID(1) IF_SHAPE(+1) + 0
#define IF_PULL(...) __VA_ARGS__
#else
#define IF_PULL(...)
#endif

/* The bit of each effect, and those of this image. */
enum {
#define EFFECT(bit, NAME, name, tag, parts, what) EFFECT_##NAME = 1 << (bit),
#include "effects.def"
#undef EFFECT
    EFFECTS_IN_IMAGE = 0
#define EFFECT(bit, NAME, name, tag, parts, what) IF_##NAME(| EFFECT_##NAME)
#include "effects.def"
#undef EFFECT
};

#endif
