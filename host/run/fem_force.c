#include "fem_force.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_errno.h>
#include <gsl/gsl_linalg.h>

#include "fem_cone.h"
#include "progress.h"

/* C d + m of a contact (viscoelastic.h). */
static float remembered_depth(const struct contact_set *set, uint32_t c, const struct viscoelastic *visco)
{
    double depth = (double)visco->step.total * (double)set->contact[c].depth_m;
    for (int a = 0; a < 3; a++)
        depth -= (double)set->contact[c].normal[a] * (double)visco->memory_m[c][a];
    return (float)depth;
}

static void fem_sample_take(struct fem_sample *sample, const struct contact_set *set, const struct cone_system *cone,
                            const struct viscoelastic *visco, uint64_t tick)
{
    memset(sample, 0, sizeof *sample);
    sample->tick = tick;
    sample->count = set->count;
    sample->rigid = contact_all(set) - set->count;
    sample->friction = cone != NULL;
    sample->stiffening = visco ? (double)visco->step.total : 1;
    memcpy(sample->force_N, set->force_N, sizeof sample->force_N);
    for (uint32_t c = 0; c < set->count; c++) {
        sample->contact[c].tool = contact_tool(&set->contact[c]);
        sample->contact[c].triangle = set->contact[c].triangle;
        memcpy(sample->contact[c].pull, set->contact[c].pull, sizeof sample->contact[c].pull);
        sample->contact[c].depth_m = visco ? remembered_depth(set, c, visco) : set->contact[c].depth_m;
        memcpy(sample->contact[c].weights, set->contact[c].weights, sizeof sample->contact[c].weights);
        memcpy(sample->contact[c].normal, set->contact[c].normal, sizeof sample->contact[c].normal);
        if (cone)
            memcpy(sample->contact[c].wanted_m, cone->contact[c].wanted_m, sizeof cone->contact[c].wanted_m);
        if (cone)
            sample->contact[c].mu = (double)cone->contact[c].mu;
        for (int a = 0; a < 3 && cone; a++)
            for (int b = 0; b < 3; b++)
                sample->contact[c].lever[a][b] = cone->levers ? cone->contact[c].lever[a][b] : (float)(a == b);
    }
    for (uint32_t c = set->count; c < contact_all(set); c++) {
        memcpy(sample->contact[c].pull, set->contact[c].pull, sizeof sample->contact[c].pull);
        memcpy(sample->contact[c].normal, set->contact[c].normal, sizeof sample->contact[c].normal);
        sample->contact[c].depth_m = set->contact[c].depth_m;
        sample->contact[c].pad_m_N = set->contact[c].pad_m_N;
    }
}

/* Values on the set {p > 0}: A_PP p_P = d_P. */
static bool polish(uint32_t m, const double *A, const double *d, double *p)
{
    uint32_t index[CONTACT_MAX], n = 0;
    double a[CONTACT_MAX * CONTACT_MAX], b[CONTACT_MAX], x[CONTACT_MAX];
    for (uint32_t i = 0; i < m; i++)
        if (p[i] > 0)
            index[n++] = i;
    if (n == 0)
        return true;
    for (uint32_t i = 0; i < n; i++) {
        b[i] = d[index[i]];
        for (uint32_t j = 0; j < n; j++)
            a[n * i + j] = A[m * index[i] + index[j]];
    }
    gsl_matrix_view matrix = gsl_matrix_view_array(a, n, n);
    gsl_vector_view right = gsl_vector_view_array(b, n), left = gsl_vector_view_array(x, n);
    gsl_error_handler_t *handler = gsl_set_error_handler_off(); /* its default ends the process */
    bool good = gsl_linalg_cholesky_decomp1(&matrix.matrix) == 0 &&
                gsl_linalg_cholesky_solve(&matrix.matrix, &right.vector, &left.vector) == 0;
    gsl_set_error_handler(handler);
    for (uint32_t i = 0; good && i < n; i++)
        p[index[i]] = x[i];
    return good;
}

int fem_complementarity(uint32_t m, const double *A, const double *d, double *p, struct failure *why)
{
    double scale = 0;
    for (uint32_t i = 0; i < m; i++) {
        p[i] = 0;
        scale = fmax(scale, fabs(d[i]));
    }
    /* Contraction is 1 - 1/cond(A) at worst; epsilon keeps cond below some 1e5. */
    double change = INFINITY;
    for (int sweep = 0; sweep < 2000000 && change > 1e-15; sweep++) {
        change = 0;
        double largest = 0;
        for (uint32_t i = 0; i < m; i++) {
            double r = d[i];
            for (uint32_t j = 0; j < m; j++)
                r -= A[m * i + j] * p[j];
            double q = fmax(p[i] + r / A[m * i + i], 0);
            change = fmax(change, fabs(q - p[i]));
            p[i] = q;
            largest = fmax(largest, q);
        }
        change = largest > 0 ? change / largest : 0;
    }
    bool good = polish(m, A, d, p);
    for (uint32_t i = 0; good && i < m; i++) {
        double w = -d[i];
        for (uint32_t j = 0; j < m; j++)
            w += A[m * i + j] * p[j];
        good = p[i] >= 0 && w >= -1e-10 * scale && (p[i] == 0 || fabs(w) <= 1e-10 * scale);
    }
    if (!good)
        return failure_set(why, STATUS_CHECK_FAILED, NULL, "look at the mesh with trocar mesh",
                           "the finite-element reference found no contact forces for %u contacts", m);
    return STATUS_OK;
}

/* epsilon_c of contact.h. */
static double pad(const struct bank_view *bank, double own_m_N)
{
    return (double)bank->contact->regularisation_m_N * fmax(1, own_m_N / (double)bank->contact->typical_compliance_m_N);
}

/* What does not give way answers to a hundredth of what tissue does, and fem_cone looks for forces with one step for all: these are
 * counted in units of so many newtons. */
#define RIGID_SCALE 16.0

/* Component a of the force on tool t under a unit force along axis b at a contact: with the tissue of three components, with what
 * does not give way along its normal only. */
static double on_tool(const struct fem_sample *sample, uint32_t c, uint32_t t, int a, int b)
{
    if (c < sample->count)
        return sample->contact[c].tool == t ? (double)sample->contact[c].lever[b][a] : 0;
    return RIGID_SCALE * (double)sample->contact[c].pull[t][a] * (double)sample->contact[c].normal[b];
}

/* The compliance of the tissue between its contacts along the axes, then of paddings and couplings among all. */
static int system_of_axes(const struct bank_view *bank, const struct body *body, const struct fem_sample *sample,
                          double *A, struct failure *why)
{
    uint32_t m = 3 * sample->count, size = m + 3 * sample->rigid, vertex[9 * CONTACT_MAX];
    double weight[9 * CONTACT_MAX], axis[9 * CONTACT_MAX] = {0};
    for (uint32_t i = 0; i < m; i++) {
        axis[3 * i + i % 3] = 1;
        for (int k = 0; k < 3; k++) {
            vertex[3 * i + k] = body->surface.triangles[3 * sample->contact[i / 3].triangle + k];
            weight[3 * i + k] = (double)sample->contact[i / 3].weights[k];
        }
    }
    int status = model_constrained(body->model, m, vertex, weight, axis, 0, NULL, NULL, A, why);
    if (status)
        return status;
    for (uint32_t i = size; i-- > 0;) /* from m to size columns, in place, from behind */
        for (uint32_t j = size; j-- > 0;)
            A[size * i + j] = i < m && j < m ? A[m * i + j] : 0;
    double softness = sample->stiffening / (double)bank->contact->coupling_stiffness_N_m;
    for (uint32_t c = 0; c < size / 3; c++) { /* epsilon_c; across a rigid one's normal, where it has no force, any */
        const float *n = sample->contact[c].normal;
        double own = 0;
        for (uint32_t i = 3 * c; i < 3 * c + 3; i++)
            own += A[size * i + i] / 3;
        bool rigid = c >= sample->count;
        double epsilon = rigid ? RIGID_SCALE * RIGID_SCALE * softness : sample->stiffening * pad(bank, own);
        for (uint32_t i = 3 * c; i < 3 * c + 3; i++)
            for (uint32_t j = 3 * c; j < 3 * c + 3; j++)
                A[size * i + j] += (i == j) * epsilon +
                                   rigid * (RIGID_SCALE * RIGID_SCALE * (double)sample->contact[c].pad_m_N - epsilon) *
                                       (double)n[i % 3] * (double)n[j % 3];
    }
    for (uint32_t i = 0; i < size; i++)
        for (uint32_t j = 0; j < size; j++)
            for (uint32_t k = 0; k < 3 * BANK_MAX_INSTRUMENTS; k++)
                A[size * i + j] += softness * on_tool(sample, i / 3, k / 3, k % 3, i % 3) *
                                   on_tool(sample, j / 3, k / 3, k % 3, j % 3);
    return STATUS_OK;
}

/* The same with friction: each contact is constrained along the three axes. */
static int fem_force_friction(const struct bank_view *bank, const struct body *body, const struct fem_sample *sample,
                              double force_N[BANK_MAX_INSTRUMENTS][3], struct failure *why)
{
    uint32_t all = sample->count + sample->rigid, size = 3 * all;
    double d[3 * CONTACT_MAX], n[3 * CONTACT_MAX], f[3 * CONTACT_MAX], mu[CONTACT_MAX];
    double *A = malloc((size_t)size * size * sizeof *A);
    if (!A)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for %u contacts", all);
    for (uint32_t i = 0; i < size; i++) {
        uint32_t c = i / 3;
        bool rigid = c >= sample->count;
        n[i] = (double)sample->contact[c].normal[i % 3];
        d[i] = rigid ? RIGID_SCALE * (double)sample->contact[c].depth_m * n[i]
                     : (double)sample->contact[c].wanted_m[i % 3];
        mu[c] = rigid ? 0 : sample->contact[c].mu;
    }
    int status = system_of_axes(bank, body, sample, A, why);
    if (!status)
        status = fem_cone(all, A, d, n, mu, f, why);
    for (uint32_t i = 0; i < size && !status; i++)
        for (uint32_t k = 0; k < 3 * BANK_MAX_INSTRUMENTS; k++)
            force_N[k / 3][k % 3] += on_tool(sample, i / 3, k / 3, k % 3, i % 3) * f[i];
    free(A);
    return status;
}

int fem_force(const struct bank_view *bank, const struct body *body, const struct fem_sample *sample,
              double force_N[BANK_MAX_INSTRUMENTS][3], struct failure *why)
{
    uint32_t m = sample->count, all = m + sample->rigid, vertex[3 * CONTACT_MAX];
    double weight[3 * CONTACT_MAX], normal[3 * CONTACT_MAX], d[CONTACT_MAX], p[CONTACT_MAX];
    double tissue[CONTACT_MAX * CONTACT_MAX], A[CONTACT_MAX * CONTACT_MAX] = {0};
    memset(force_N, 0, BANK_MAX_INSTRUMENTS * sizeof *force_N);
    if (m == 0)
        return STATUS_OK;
    if (sample->friction)
        return fem_force_friction(bank, body, sample, force_N, why);
    for (uint32_t c = 0; c < m; c++) {
        d[c] = (double)sample->contact[c].depth_m;
        for (int k = 0; k < 3; k++) {
            vertex[3 * c + k] = body->surface.triangles[3 * sample->contact[c].triangle + k];
            weight[3 * c + k] = (double)sample->contact[c].weights[k];
            normal[3 * c + k] = (double)sample->contact[c].normal[k];
        }
    }
    /* The tissue's compliance between its contacts; p without coupling and unilaterality is not used. */
    double epsilon = sample->stiffening * (double)bank->contact->regularisation_m_N;
    int status = model_constrained(body->model, m, vertex, weight, normal, epsilon, d, p, tissue, why);
    if (status)
        return status;
    for (uint32_t c = m; c < all; c++)
        d[c] = (double)sample->contact[c].depth_m;
    double softness = sample->stiffening / (double)bank->contact->coupling_stiffness_N_m;
    for (uint32_t c = 0; c < all; c++) {
        for (uint32_t e = 0; e < all; e++) {
            double sum = 0;
            for (int k = 0; k < 3 * BANK_MAX_INSTRUMENTS; k++)
                sum += (double)sample->contact[c].pull[k / 3][k % 3] * (double)sample->contact[e].pull[k / 3][k % 3];
            A[all * c + e] = softness * sum + (c < m && e < m ? tissue[m * c + e] : 0);
        }
        A[all * c + c] +=
            c < m ? sample->stiffening * pad(bank, tissue[m * c + c]) : (double)sample->contact[c].pad_m_N;
    }
    status = fem_complementarity(all, A, d, p, why);
    for (uint32_t c = 0; c < all && !status; c++)
        for (int k = 0; k < 3 * BANK_MAX_INSTRUMENTS; k++)
            force_N[k / 3][k % 3] += p[c] * (double)sample->contact[c].pull[k / 3][k % 3];
    return status;
}

void fem_record_start(struct fem_record *record, uint32_t every)
{
    *record = (struct fem_record){.stride = every ? every : 1, .fixed_stride = every != 0};
}

void fem_record_free(struct fem_record *record)
{
    free(record->sample);
    *record = (struct fem_record){0};
}

static bool make_room(struct fem_record *record)
{
    if (record->count < record->room)
        return true;
    size_t room = record->room ? 2 * record->room : FEM_SPREAD;
    struct fem_sample *larger = realloc(record->sample, room * sizeof *larger);
    if (!larger)
        return false; /* fewer samples are no harm */
    record->sample = larger;
    record->room = room;
    return true;
}

void fem_record_tick(struct fem_record *record, const struct contact_set *set, const struct cone_system *cone,
                     const struct viscoelastic *visco, uint64_t tick)
{
    if (set->count == 0)
        return;
    for (int t = 0; t < BANK_MAX_INSTRUMENTS; t++) {
        const float *f = set->force_N[t];
        float force2 = f[0] * f[0] + f[1] * f[1] + f[2] * f[2];
        if (force2 > record->peak_force2_N2[t]) {
            record->peak_force2_N2[t] = force2;
            fem_sample_take(&record->peak[t], set, cone, visco, tick);
        }
    }
    uint64_t number = record->contact_ticks++;
    if (number % record->stride)
        return;
    if (!record->fixed_stride && record->count == FEM_SPREAD) {
        for (size_t i = 0; i < FEM_SPREAD / 2; i++)
            record->sample[i] = record->sample[2 * i];
        record->count = FEM_SPREAD / 2;
        record->stride *= 2;
        if (number % record->stride)
            return;
    }
    if (make_room(record))
        fem_sample_take(&record->sample[record->count++], set, cone, visco, tick);
}

static double length(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* The sample with the contacts of one tool only; what is between it and the other is not. */
static struct fem_sample alone(const struct fem_sample *sample, uint32_t tool)
{
    struct fem_sample own = *sample;
    own.count = own.rigid = 0;
    for (uint32_t c = 0; c < sample->count; c++)
        if (sample->contact[c].tool == tool)
            own.contact[own.count++] = sample->contact[c];
    for (uint32_t c = sample->count; c < sample->count + sample->rigid; c++) {
        const float *other = sample->contact[c].pull[1 - tool];
        if (other[0] == 0 && other[1] == 0 && other[2] == 0)
            own.contact[own.count + own.rigid++] = sample->contact[c];
    }
    return own;
}

/* One sample; `largest`: of |f - f_fem| so far, per instrument. */
static int compare_sample(const struct bank_view *bank, const struct body *body, const struct fem_sample *sample,
                          struct fem_comparison *to, double largest[BANK_MAX_INSTRUMENTS], struct failure *why)
{
    double f[BANK_MAX_INSTRUMENTS][3], own[BANK_MAX_INSTRUMENTS][3], difference[3];
    int status = fem_force(bank, body, sample, f, why);
    for (uint32_t t = 0; t < bank->tool_count && !status; t++) {
        for (int k = 0; k < 3; k++)
            difference[k] = (double)sample->force_N[t][k] - f[t][k];
        largest[t] = fmax(largest[t], length(difference));
        to->instrument[t].peak_force_N = fmax(to->instrument[t].peak_force_N, length(f[t]));
        const struct fem_sample mine = alone(sample, t);
        if (mine.count == 0 || mine.count + mine.rigid == sample->count + sample->rigid)
            continue;
        status = fem_force(bank, body, &mine, own, why);
        for (int k = 0; k < 3; k++)
            difference[k] = f[t][k] - own[t][k];
        to->instrument[t].from_other_N = fmax(to->instrument[t].from_other_N, length(difference));
    }
    to->compared += !status;
    return status;
}

int fem_compare(const struct bank_view *bank, const struct body *body, const struct fem_record *record,
                struct fem_comparison *comparison, struct failure *why)
{
    *comparison = (struct fem_comparison){0};
    double largest[BANK_MAX_INSTRUMENTS] = {0};
    for (size_t i = 0; i < record->count + bank->tool_count; i++) {
        const struct fem_sample *sample = i < record->count ? &record->sample[i] : &record->peak[i - record->count];
        if (sample->count == 0)
            continue;
        if (interrupted())
            return failure_set(why, STATUS_INTERRUPTED, NULL, NULL, "interrupted during the finite-element comparison");
        int status = compare_sample(bank, body, sample, comparison, largest, why);
        if (status)
            return status;
    }
    for (uint32_t t = 0; t < bank->tool_count; t++) {
        const double peak_N = comparison->instrument[t].peak_force_N;
        if (peak_N > 0)
            comparison->instrument[t].error = largest[t] / peak_N;
        comparison->peak_force_N = fmax(comparison->peak_force_N, peak_N);
        comparison->error = fmax(comparison->error, comparison->instrument[t].error);
    }
    return STATUS_OK;
}
