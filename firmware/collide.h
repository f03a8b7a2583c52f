/* Collision of the instrument's points with the body's rest surface: a swept segment per tick and point against a uniform
 * grid, so that no speed tunnels; then, while in contact, an anchor that slides on the surface over the point.
 *
 * Anchor: the surface point a whose interpolated normal m passes through the tool point x, x = a - t m. Vertex normals are
 * interpolated linearly over the triangle, so anchor, normal and depth are continuous when the tool crosses an edge; the
 * nearest point of a faceted surface would jump there. Contact begins when the sweep enters a triangle from outside and
 * ends when the depth is no longer positive. */
#ifndef TROCAR_COLLIDE_H
#define TROCAR_COLLIDE_H

#include <stdbool.h>
#include <stdint.h>

#include "bank_view.h"
#include "effects/image.h"

enum {
    COLLIDE_TOOLS = 1 IF_SECOND(+1), /* instruments that the image serves at once */
    COLLIDE_MAX_WALK = 24            /* Newton steps and triangle crossings that an anchor may take in one tick */
};

/* "Deep" is deeper than a cell of the grid, about two edges of the mesh. Deep points need more care:
 * - Beyond the surface's radius of curvature neighbouring normals have crossed and the anchor is not defined. Then the
 *   anchor follows a point raised towards the surface, by halves, until it is: it keeps sliding with the tool.
 * - An anchor may turn by at most acos(COLLIDE_TURN) while its point is deep, or it would creep around a rim to the far
 *   side, from where the way out of the body looks like a way in.
 * - Every tick one deep point is asked whether it is still inside the body. If not, it has pushed through a thin part when
 *   the shaft behind it passes through the body and tissue lies before it; else it has left and the contact is over. */
#define COLLIDE_TURN 0.2f

struct collide_hit {
    uint32_t triangle;
    float weights[3]; /* barycentric, sum 1 */
    float fraction;   /* along the segment, 0 <= fraction < 1 */
};

struct collide_point {
    bool known; /* position_m is valid: the next segment starts there */
    bool touching;
    float position_m[3];
    uint32_t triangle; /* of the anchor */
    float weights[3];
    float anchor_m[3], normal[3]; /* outward unit normal */
    float shallow_normal[3];      /* the normal when the point was last not deep */
    float depth_m;                /* normal . (anchor - position), > 0 while touching */
};

struct collide {
    uint32_t count; /* points of all tools, <= BANK_MAX_TOOL_POINTS */
    struct collide_range {
        uint32_t first, count;
    } tool[COLLIDE_TOOLS]; /* the points of each */
    struct collide_point point[BANK_MAX_TOOL_POINTS];
    uint32_t turn;      /* the point that is next asked whether it has left */
    uint32_t walks_cut; /* counter: an anchor did not settle, was raised, or was held back from turning */
};

/* Whose point it is. */
static inline uint32_t collide_tool(const struct collide *s, uint32_t point)
{
    uint32_t tool = 0;
    (void)s, (void)point;
    IF_SECOND(tool = point >= s->tool[0].count;)
    return tool;
}

/* First triangle that the segment from -> to enters from outside, that is against its normal: the end `from` on or above
 * the triangle's plane, `to` below it. Equal fractions: the lower triangle number. Work: at most nx + ny + nz + 1 cells,
 * each with at most max_in_cell triangles. Agreement with collide_brute is a test. */
bool collide_sweep(const struct bank_view *bank, const float from_m[3], const float to_m[3], struct collide_hit *hit);

/* The same by looking at every triangle: for tests, and for the host to find where an axis meets the body. */
bool collide_brute(const struct bank_view *bank, const float from_m[3], const float to_m[3], struct collide_hit *hit);

/* The points of the bank's tools, one tool after the other; none is known yet. */
void collide_start(struct collide *s, const struct bank_view *bank);

/* Once per tick, before the tools are moved. */
void collide_begin(struct collide *s);

/* Move every point of a tool to its new position and update its contact. `apex_m`: the trocar, from where the shaft comes. */
void collide_update(struct collide *s, const struct bank_view *bank, uint32_t tool, const float apex_m[3],
                    const float (*positions_m)[3]);

/* The anchor of a touching point (triangle, weights): anchor_m, normal and depth_m of position_m there. */
void collide_measure(const struct bank_view *bank, struct collide_point *p);

/* Let it slide over the surface to where its normal passes through position_m, or through the point raised along that
 * normal, then measure. False when it was raised or did not come to rest. */
bool collide_settle(const struct bank_view *bank, struct collide_point *p);

/* Forget positions and contacts of a tool: after a silence the way between is not known. */
void collide_forget(struct collide *s, uint32_t tool);

#endif
