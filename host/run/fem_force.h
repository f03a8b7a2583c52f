/* The force that a full finite-element solve gives for the very contacts of a tick, by another method and in double
 * precision: nothing here is shared with the controller but the numbers that describe the contacts.
 *
 * Given contacts (triangle, weights, normal n_c, depth d_c) of a tick, the compliance between them comes from the sparse
 * factor of K (a solve per contact, not the bank); A_cd = n_c.C_cd n_d + sum_t (q_ct.q_dt)/k + epsilon [c = d] with the bank's k
 * and epsilon, and q_ct what a unit push at c is at the tip of instrument t (contact.h, `pull`); then p >= 0, A p - d >= 0,
 * p.(A p - d) = 0 by projected Gauss-Seidel, polished by a dense solve on the set that it found, and the three conditions are
 * checked. The force on instrument t is sum p_c q_ct. All instruments' contacts are in one solve; solved again with one's own alone
 * they tell what it feels of the other.
 *
 * With friction or grasping (a cone_system of the tick is given) there are three unknowns a contact and Coulomb's law in place of the
 * complementarity: fem_cone.h, with the displacements that the controller asks of the tissue.
 *
 * With visco-elastic tissue depths and coupling are those of viscoelastic.h; what the tissue remembers is the controller's.
 *
 * Rigid contacts (effects/rigid.h) are in the same solve, without compliance of their own; where they are is the controller's.
 *
 * So the comparison covers the bank's numbers, their reading, the assembly and the active-set solver in single
 * precision. Not covered: where the contacts are (collision has its own tests) and the mesh's discretisation error. */
#ifndef TROCAR_FEM_FORCE_H
#define TROCAR_FEM_FORCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "bank.h"
#include "contact.h"
#include "effects/cone.h"
#include "effects/viscoelastic.h"

/* What is kept of a tick. */
struct fem_sample {
    uint64_t tick;
    uint32_t count, rigid; /* contacts with the tissue, and behind them those with what does not give way */
    struct {
        uint32_t tool, triangle;
        float weights[3], normal[3], depth_m;
        float pull[BANK_MAX_INSTRUMENTS][3];
        float wanted_m[3]; /* with a cone_system, */
        float lever[3][3]; /* the same: at the tip, of a unit force along each axis */
        double mu;         /* the same; below 0: held */
        float pad_m_N;     /* of a rigid one, of which also normal, depth_m and pull are known */
    } contact[CONTACT_MAX];
    bool friction;
    double stiffening;                      /* C of viscoelastic.h, then depth_m is C d + m; 1 without that effect */
    float force_N[BANK_MAX_INSTRUMENTS][3]; /* the controller's answer: of the tissue on each tool */
};

/* Samples of a run whose length is not known: every `stride`-th contact tick; when FEM_SPREAD are held and no stride was
 * asked for, every other one is dropped and the stride doubles, so 8 to 16 stay, spread evenly; and the peak of each. */
enum { FEM_SPREAD = 16 };
struct fem_record {
    uint64_t contact_ticks;
    uint32_t stride;
    bool fixed_stride;
    size_t count, room;
    struct fem_sample *sample; /* malloc */
    struct fem_sample peak[BANK_MAX_INSTRUMENTS];
    float peak_force2_N2[BANK_MAX_INSTRUMENTS];
};
void fem_record_start(struct fem_record *record, uint32_t every); /* 0: spread */
/* `cone`: of the tick, contacts in the order of the set; NULL without friction. `visco`: after the tick; NULL without. */
void fem_record_tick(struct fem_record *record, const struct contact_set *set, const struct cone_system *cone,
                     const struct viscoelastic *visco, uint64_t tick);
void fem_record_free(struct fem_record *record);

/* The comparison: solves all of them. `error`: the largest of the instruments' (0 compared: there was no contact). */
struct fem_comparison {
    uint32_t compared;
    double error, peak_force_N;
    struct {
        double error, peak_force_N; /* largest |f - f_fem| / peak |f_fem|, and that peak */
        double from_other_N;        /* largest |f_fem - f_fem with its own contacts alone| */
    } instrument[BANK_MAX_INSTRUMENTS];
};
int fem_compare(const struct bank_view *bank, const struct body *body, const struct fem_record *record,
                struct fem_comparison *comparison, struct failure *why);

/* Force on each tool (N, world) by the full solve; STATUS_CHECK_FAILED when no solution of the conditions was found. */
int fem_force(const struct bank_view *bank, const struct body *body, const struct fem_sample *sample,
              double force_N[BANK_MAX_INSTRUMENTS][3], struct failure *why);

/* The complementarity problem alone: m <= CONTACT_MAX, A row-major m x m, symmetric positive definite. */
int fem_complementarity(uint32_t m, const double *A, const double *d, double *p, struct failure *why);

#endif
