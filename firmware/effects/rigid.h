/* Rigid contact: instruments against each other, and against what does not give way beside the organ (bone, a port, a retractor).
 *
 * An instrument is made of convex pieces, each a hull of one or two points with a radius (convex.h): the cannula, from the trocar
 * along the axis as far as it reaches into the body; the shaft, from there to the tip; the tip, a ball, where it is thicker than the
 * shaft. An obstacle is a hull of up to BANK_MAX_OBSTACLE_POINTS points with a radius. Two bodies touch at most in one place: the
 * pieces whose contact would push the hand most.
 *
 *   normal n from the other body to the instrument, points a on its core, b on the other's core, R the sum of the radii
 *   depth = R - n . (a - b)                             of the device's pose
 *   pull  = n_z z + (s / L) (n - n_z z)                 the tip force that does the work of n at a, on the proxy's axis z at s from the
 *                                                       trocar; -n at b for another instrument; of a cannula without n_z z
 *
 * They enter the contact system behind the tissue's contacts (contact.h) without compliance of their own: what gives way is the
 * virtual coupling of each instrument, so the hand never feels more than its stiffness, and two instruments feel equal and opposite
 * forces at the place where they touch.
 *
 * n, a and b are those of the closest points of the *proxies* of the last tick, the poses in which nothing was penetrated. There
 * the cores are apart, always, so there is always a normal, whatever the devices do: that is the memory of the side. A device
 * that has passed through an obstacle, in one tick or pressed slowly, is pushed back the way it came; it is free when it is
 * clear of the obstacle and no plane between them says that the cores crossed on the way. A proxy slides along an obstacle and around its
 * end as a rigid shaft would.
 *
 * Forces are those of a potential k/2 |proxy - device|^2 but for the lag of a tick in the normal, which takes energy: sliding at v
 * over a radius of curvature R turns it by v T / R against the motion. No friction. Validity: shared/effects/rigid.md. */
#ifndef TROCAR_EFFECTS_RIGID_H
#define TROCAR_EFFECTS_RIGID_H

#include "contact.h"
#include "effects/convex.h"
#include "kinematics.h"

/* Pieces further apart than their radii and this are left alone. */
#define RIGID_NEAR_m 0.005f
/* What a contact gives way beside the couplings, of what they do: several contacts with one normal stay a definite system. The bank's
 * regularisation, made for soft tissue, would let shafts sink into each other by centimetres. */
#define RIGID_GIVE 1e-3f
/* Where the lever is below this (squared: nearer to the trocar than a hundredth of the insertion) a contact is not felt. */
#define RIGID_LEAST_PULL2 1e-4f

enum rigid_piece { RIGID_CANNULA, RIGID_SHAFT, RIGID_TIP, RIGID_PIECES };

/* On which side of the other a piece is. */
struct rigid_side {
    bool known;
    float normal[3];
};

struct rigid {
    struct {
        bool known;
        float proxy_m[3]; /* tip of the proxy after the last tick */
        struct rigid_side side[BANK_MAX_OBSTACLES][RIGID_PIECES];
    } tool[CONTACT_TOOLS];
    IF_SECOND(struct rigid_side across[RIGID_PIECES][RIGID_PIECES];) /* of instrument 0, of instrument 1 */
};

int rigid_open(struct bank_view *view);

/* The most contacts that a tick can have. */
uint32_t rigid_most(const struct bank_view *bank);

/* Insertion at which the tip meets the rim of the cannula, or 0: a tip that is not thicker than the cannula goes through it. */
float rigid_stop(const struct bank_view *bank, uint32_t tool);

/* The stages of hooks.h. `pose`: of each instrument, NULL when it is not known. */
void rigid_respond(struct rigid *r, const struct bank_view *bank, struct contact_set *set,
                   const struct kinematics *const pose[CONTACT_TOOLS]);
/* Where the whole system is scaled, couplings and all, as for visco-elastic tissue: depths and what gives way of the rigid contacts,
 * which have no memory. */
void rigid_stiffen(struct contact_set *set, float stiffening);
void rigid_follow(struct rigid *r, const struct contact_set *set, const struct kinematics *const pose[CONTACT_TOOLS]);
void rigid_forget(struct rigid *r, uint32_t tool);

#endif
