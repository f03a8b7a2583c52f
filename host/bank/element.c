#include "element.h"

struct lame lame_from_young(double E_Pa, double nu)
{
    return (struct lame){.lambda_Pa = E_Pa * nu / ((1 + nu) * (1 - 2 * nu)), .mu_Pa = E_Pa / (2 * (1 + nu))};
}

static void cross(const double a[3], const double b[3], double c[3])
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

struct element element_geometry(const double *nodes, const uint32_t vertex[4])
{
    double edge[3][3], normal[3][3];
    for (int k = 0; k < 3; k++)
        for (int a = 0; a < 3; a++)
            edge[k][a] = nodes[3 * (size_t)vertex[k + 1] + a] - nodes[3 * (size_t)vertex[0] + a];
    for (int k = 0; k < 3; k++)
        cross(edge[(k + 1) % 3], edge[(k + 2) % 3], normal[k]);
    double six_volumes = edge[0][0] * normal[0][0] + edge[0][1] * normal[0][1] + edge[0][2] * normal[0][2];

    struct element element = {.volume_m3 = six_volumes / 6};
    for (int a = 0; a < 3; a++) {
        for (int k = 0; k < 3; k++)
            element.shape_1_m[k + 1][a] = normal[k][a] / six_volumes;
        element.shape_1_m[0][a] = -(element.shape_1_m[1][a] + element.shape_1_m[2][a] + element.shape_1_m[3][a]);
    }
    return element;
}

void element_add_block(const struct element *element, struct lame material, int j, int k, double block[9])
{
    const double *alpha_j = element->shape_1_m[j], *alpha_k = element->shape_1_m[k];
    double lambda = element->volume_m3 * material.lambda_Pa, mu = element->volume_m3 * material.mu_Pa;
    double dot = alpha_j[0] * alpha_k[0] + alpha_j[1] * alpha_k[1] + alpha_j[2] * alpha_k[2];
    for (int a = 0; a < 3; a++) {
        for (int b = 0; b < 3; b++)
            block[3 * a + b] += lambda * alpha_j[a] * alpha_k[b] + mu * alpha_k[a] * alpha_j[b];
        block[4 * a] += mu * dot;
    }
}
