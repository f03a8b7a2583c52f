#include "element.h"

#include "hooke.h"

const unsigned char element_edge[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};

size_t element_nodes(enum element_order order)
{
    return order == ELEMENT_QUADRATIC ? 10 : 4;
}

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

/* The gradient of a shape function: a sum of terms (constant + slope L_along) alpha_corner. */
struct gradient_term {
    double constant, slope;
    size_t along, corner;
};

static int gradient(enum element_order order, size_t node, struct gradient_term term[2])
{
    if (node < 4) {
        bool linear = order == ELEMENT_LINEAR;
        term[0] = (struct gradient_term){linear ? 1 : -1, linear ? 0 : 4, node, node};
        return 1;
    }
    size_t a = element_edge[node - 4][0], b = element_edge[node - 4][1];
    term[0] = (struct gradient_term){0, 4, a, b};
    term[1] = (struct gradient_term){0, 4, b, a};
    return 2;
}

void element_gradients(const struct element *element, enum element_order order, const double L[4],
                       double (*gradients)[3])
{
    for (size_t j = 0; j < element_nodes(order); j++) {
        struct gradient_term term[2];
        int terms = gradient(order, j, term);
        for (int a = 0; a < 3; a++) {
            gradients[j][a] = 0;
            for (int p = 0; p < terms; p++)
                gradients[j][a] +=
                    (term[p].constant + term[p].slope * L[term[p].along]) * element->shape_1_m[term[p].corner][a];
        }
    }
}

/* Mean over the element of (c + s L_i)(d + t L_j): the mean of L is 1/4, that of L_i L_j 1/20, of L_i^2 1/10. */
static double mean_product(const struct gradient_term *x, const struct gradient_term *y)
{
    return x->constant * y->constant + (x->constant * y->slope + x->slope * y->constant) / 4 +
           x->slope * y->slope * (x->along == y->along ? 2 : 1) / 20;
}

static void add_mean(const struct element *element, const struct gradient_term *term, int terms, double mean[3])
{
    for (int p = 0; p < terms; p++)
        for (int a = 0; a < 3; a++)
            mean[a] += (term[p].constant + term[p].slope / 4) * element->shape_1_m[term[p].corner][a];
}

/* V0 sum over bd of C_abcd M_bd. */
static void add_anisotropic(double volume_m3, const double C[6][6], const double M[3][3], double block[9])
{
    for (int a = 0; a < 3; a++)
        for (int c = 0; c < 3; c++) {
            double sum = 0;
            for (int b = 0; b < 3; b++)
                for (int d = 0; d < 3; d++)
                    sum += C[hooke_place[a][b]][hooke_place[c][d]] * M[b][d];
            block[3 * a + c] += volume_m3 * sum;
        }
}

void element_add_block(const struct element *element, const struct hooke *material, enum element_order order, size_t j,
                       size_t k, double block[9])
{
    struct gradient_term left[2], right[2];
    int lefts = gradient(order, j, left), rights = gradient(order, k, right);
    double M[3][3] = {{0}}; /* mean of g_j (x) g_k */
    for (int p = 0; p < lefts; p++)
        for (int q = 0; q < rights; q++) {
            double mean = mean_product(&left[p], &right[q]);
            const double *alpha_p = element->shape_1_m[left[p].corner], *alpha_q = element->shape_1_m[right[q].corner];
            for (int a = 0; a < 3; a++)
                for (int b = 0; b < 3; b++)
                    M[a][b] += mean * alpha_p[a] * alpha_q[b];
        }
    if (order == ELEMENT_QUADRATIC) {
        double mean_j[3] = {0}, mean_k[3] = {0}, volume = element->volume_m3 * material->volume_Pa;
        add_mean(element, left, lefts, mean_j);
        add_mean(element, right, rights, mean_k);
        for (int c = 0; c < 9; c++)
            block[c] += volume * (mean_j[c / 3] * mean_k[c % 3] - M[c / 3][c % 3]);
    }
    if (!material->isotropic) {
        add_anisotropic(element->volume_m3, material->C, M, block);
        return;
    }
    double lambda = element->volume_m3 * material->lame.lambda_Pa, mu = element->volume_m3 * material->lame.mu_Pa;
    double dot = M[0][0] + M[1][1] + M[2][2];
    for (int a = 0; a < 3; a++) {
        for (int b = 0; b < 3; b++)
            block[3 * a + b] += lambda * M[a][b] + mu * M[b][a];
        block[4 * a] += mu * dot;
    }
}
