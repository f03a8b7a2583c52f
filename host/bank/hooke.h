/* Hooke's law of a material: sigma_ab = sum over cd of C_abcd eps_cd, isotropic by Lame's constants, else by the whole
 * tensor. C[v][w] holds C_abcd with v the place of ab and w that of cd in xx yy zz yz xz xy (Voigt's order): true tensor
 * components, so that a strain in Voigt's notation carries 2 eps_ab in its shear places.
 *
 * Engineering constants along the axes of symmetry 1, 2, 3 (Lekhnitskii; Jones, Mechanics of Composite Materials 2.3):
 * eps_11 = s_11/E_1 - nu_12 s_22/E_1 ... with nu_12 the contraction along 2 under a pull along 1, and
 * nu_ij/E_i = nu_ji/E_j. Transversely isotropic with the fibres along 1 (L; T across): E_2 = E_3 = E_T,
 * nu_12 = nu_13 = nu_LT, G_12 = G_13 = G_LT, G_23 = E_T / (2 (1 + nu_TT)).
 *
 * The tensor is positive definite (hence the system elliptic, and stable) if and only if every E_i and G_ij is above 0,
 * |nu_ij| < sqrt(E_i/E_j) for each pair, and
 *   D = 1 - nu_12 nu_21 - nu_23 nu_32 - nu_31 nu_13 - 2 nu_21 nu_32 nu_13 > 0;
 * D goes to 0 as the material becomes incompressible (isotropic: D = (1 + nu)^2 (1 - 2 nu)). */
#ifndef TROCAR_HOOKE_H
#define TROCAR_HOOKE_H

#include "element.h"
#include "failure.h"
#include "scene.h"

struct hooke {
    bool isotropic;
    struct lame lame; /* when isotropic */
    double C[6][6];   /* Pa, when not */
    /* The part that answers to the change of volume alone, which quadratic elements take in the mean (element.h): lambda; of
     * an anisotropic material K - 2/3 G with the bulk modulus K under uniform pressure and the smallest G, or 0. What is
     * left of the law without it is positive. */
    double volume_Pa;
};

/* Place of the pair ab in Voigt's order. */
extern const unsigned char hooke_place[3][3];

struct hooke hooke_isotropic(double E_Pa, double nu);

/* Of a material of the scene, in the world's axes; `axis` are its axes 1, 2, 3 (orthonormal, one per row), NULL for those
 * that the material names. STATUS_MODEL_MATERIAL with the condition that fails; isotropic ones need 0 <= nu < 0.5. */
int hooke_of_material(const struct scene *scene, const struct scene_material *material, const double axis[3][3],
                      struct hooke *hooke, struct failure *why);

/* Axes 1, 2, 3 from a direction for 1 and, for an orthotropic material, one for 2 that is made square to it; false when
 * there is none. Without `across` any square direction serves. */
bool hooke_axes(const double along[3], const double *across, double axis[3][3]);

#endif
