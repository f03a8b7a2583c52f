/* The instrument's shape: shaft and jaws are swept spheres (capsules), sampled by spheres along their axes. Each point of the
 * tool is then the centre of a sphere of radius r.
 *
 * A sphere touches where its centre is nearer to the surface than r. Its contact is that of the point of the sphere which lies
 * deepest, x = centre - r n, so with the centre's own anchor a and interpolated normal n (collide.h, continuous over edges),
 *
 *   depth = r + n . (a - centre)
 *
 * whether the centre lies inside the body or still outside. Inside, collide.h has the anchor. Outside, the walk begins at a seed:
 * the triangle nearest to the middle of the cell that the centre is in, from a coarse grid in the bank; from then on the
 * anchor slides along with the centre. Where two sheets of the surface run through one cell there are two seeds and the nearer
 * place is taken. One free sphere a tick looks at its seeds again. The centre's swept segment stays as in collide.h, so no speed
 * tunnels through what a sphere cannot pass: samples nearer to each other than that.
 *
 * Centres, in the instrument's frame, with roll rho and the jaws' half angle theta, which falls from `opening` at the grip's count 0
 * to none at BANK_MAX_GRIP and follows the grip with 10 ms (SHAPE_BLEND), as the jaws have mass and counts have steps:
 *
 *   turn(rho) (centre + along (side sin theta, 0, [side != 0] cos theta))
 *
 * Forces act where the sphere touches, with the lever that this has about the trocar (kinematics.h, kinematics_pull).
 * Validity: shared/effects/shape.md. */
#ifndef TROCAR_SHAPE_H
#define TROCAR_SHAPE_H

#include "bank_view.h"
#include "collide.h"
#include "contact.h"
#include "effects/cone.h"
#include "kinematics.h"

#define SHAPE_BLEND 0.1f

struct shape_tool {
    bool started;  /* the grip is known */
    float grip;    /* counts, smoothed */
    uint16_t roll; /* raw counts */
};

struct shape {
    struct shape_tool tool[BANK_MAX_INSTRUMENTS];
    float centre_depth_m[BANK_MAX_TOOL_POINTS]; /* n . (a - centre) */
    uint32_t near;                              /* bit per point: centre outside, and its anchor is known */
    uint32_t outside;                           /* bit per point: its sphere touches, its centre is outside */
    uint32_t turn;                              /* the sphere that next looks at its seeds again */
    uint32_t lost;                              /* counter: a touching sphere whose anchor could not follow */
};

int shape_open(struct bank_view *view);

/* The stages of hooks.h. A sample of an instrument: raw counts; */
void shape_sense(struct shape *s, uint32_t tool, uint16_t roll, uint16_t grip);
/* where the centres of its points are, points_m[first .. first + count - 1]; */
void shape_move(const struct shape *s, const struct bank_view *bank, uint32_t tool, uint32_t first, uint32_t count,
                const struct kinematics *k, float (*points_m)[3]);
/* around the collision, which is about centres: what touches from outside is free to it before, and touches after; */
void shape_hide(const struct shape *s, struct collide *points);
void shape_touch(struct shape *s, const struct bank_view *bank, struct collide *points);
/* levers of a tool's contacts, for pushes and for forces of three components; */
void shape_place(const struct bank_view *bank, struct contact_set *set, const struct collide *points, uint32_t tool,
                 const struct kinematics *k);
IF_CONE(void shape_levers(const struct bank_view *bank, const struct contact_set *set, const struct collide *points,
                          uint32_t tool, const struct kinematics *k, struct cone_system *cone);)
/* rows that a free sphere near the surface will ask for. */
void shape_expect(const struct shape *s, const struct bank_view *bank, struct row_cache *rows,
                  const struct collide *points);
void shape_forget(struct shape *s, uint32_t tool, uint32_t first, uint32_t count);

#endif
