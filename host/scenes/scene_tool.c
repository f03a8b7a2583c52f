#include "scene.h"

#include <math.h>
#include <string.h>

#include "device.h"

static const double PI = 3.14159265358979323846;
static const double TICK_s = 1e-3;
static const double RISE_s = 5e-3;   /* from no force to the limit: five ticks, above the 120 Hz of the motors */
static const double DECAY_s = 20e-3; /* faster than a hand reacts, slower than a blow */

static double smaller(double a, double b)
{
    return a < b ? a : b;
}

void scene_coupling(const struct scene_instrument *instrument, const struct device_model *device,
                    struct scene_coupling *coupling)
{
    double viscous = INFINITY, friction_limit = INFINITY;
    for (int i = 0; i < 3; i++) {
        const struct device_axis_model *axis = &device->axis[i];
        double arm = i < 2 ? instrument->length_max_m : 1; /* of the tip about the trocar */
        viscous = smaller(viscous, axis->viscous / (arm * arm));
        friction_limit = smaller(friction_limit, 2 * (axis->coulomb / arm) / (fabs(axis->per_count) * arm));
    }
    double damping = instrument->coupling_damping_Ns_m > 0 ? instrument->coupling_damping_Ns_m : viscous / 5;
    double largest = smaller(2 * (viscous - damping) / TICK_s, friction_limit);
    *coupling = (struct scene_coupling){
        .stiffness_N_m = instrument->coupling_stiffness_N_m > 0 ? instrument->coupling_stiffness_N_m : largest / 2,
        .damping_Ns_m = damping,
        .device_damping_Ns_m = viscous,
        .largest_stiffness_N_m = largest,
    };
}

static void frame(const double axis[3], float rotation[9])
{
    double Z[3], X[3], Y[3], length = sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
    for (int i = 0; i < 3; i++)
        Z[i] = axis[i] / length;
    int e = fabs(Z[0]) > 0.9 ? 1 : 0;
    for (int i = 0; i < 3; i++)
        X[i] = (i == e) - Z[e] * Z[i];
    length = sqrt(X[0] * X[0] + X[1] * X[1] + X[2] * X[2]);
    for (int i = 0; i < 3; i++)
        X[i] /= length;
    for (int i = 0; i < 3; i++)
        Y[i] = Z[(i + 1) % 3] * X[(i + 2) % 3] - Z[(i + 2) % 3] * X[(i + 1) % 3];
    for (int i = 0; i < 3; i++) {
        rotation[3 * i + 0] = (float)X[i];
        rotation[3 * i + 1] = (float)Y[i];
        rotation[3 * i + 2] = (float)Z[i];
    }
}

/* `count` points on the ring at `polar` from the apex, the first at `turn` of a step. */
static void ring(float (*point)[3], unsigned count, double radius_m, double polar, double turn)
{
    for (unsigned k = 0; k < count; k++) {
        double around = 2 * PI * (k + turn) / count;
        point[k][0] = (float)(radius_m * sin(polar) * cos(around));
        point[k][1] = (float)(radius_m * sin(polar) * sin(around));
        point[k][2] = (float)(-radius_m * (1 - cos(polar)));
    }
}

static void tip_points(float (*point)[3], unsigned count, double radius_m)
{
    memset(point[0], 0, sizeof point[0]);
    unsigned others = count - 1;
    if (count <= 7) {
        ring(point + 1, others, radius_m, PI / 4, 0);
        return;
    }
    unsigned inner = (others + 1) / 3;
    ring(point + 1, inner, radius_m, PI / 6, 0);
    ring(point + 1 + inner, others - inner, radius_m, PI / 3, 0.5);
}

int scene_tool(const struct scene_instrument *instrument, struct bank_tool *tool, struct failure *why)
{
    const struct device_model *device = device_model_find(instrument->device);
    if (!device)
        return failure_set(why, STATUS_SCENE_VALUE, instrument->name, NULL,
                           "device '%s' is not known; this version has: %s", instrument->device, device_model_names());
    if (!instrument->placed)
        return failure_set(why, STATUS_SCENE_MISSING, instrument->name, "give its trocar",
                           "the instrument has no place");
    if (instrument->tip_points < 1 || instrument->tip_points > BANK_MAX_TOOL_POINTS)
        return failure_set(why, STATUS_SCENE_VALUE, instrument->name, NULL, "%u points: 1 to %d are possible",
                           instrument->tip_points, BANK_MAX_TOOL_POINTS);
    memset(tool, 0, sizeof *tool);
    frame(instrument->axis, tool->rotation);
    for (int i = 0; i < 3; i++) {
        const struct device_axis_model *from = &device->axis[i];
        tool->axis[i] = (struct bank_axis){
            .per_count = (float)from->per_count,
            .zero = (float)from->zero,
            .count_zero = from->count_zero,
            .count_modulus = from->count_modulus,
            .minimum = (float)(i == 2 ? instrument->length_min_m : from->minimum),
            .maximum = (float)(i == 2 ? instrument->length_max_m : from->maximum),
            .speed_limit = (float)from->speed_limit,
            .effort_limit = (float)from->effort_limit,
        };
        tool->trocar_m[i] = (float)instrument->trocar_m[i];
        tool->gravity_direction[i] = tool->rotation[3 * i + 2];
    }
    tool->gravity_N = (float)device->gravity_N;
    tool->gravity_arm_m = (float)device->gravity_arm_m;
    tool->tip_radius_m = (float)instrument->tip_radius_m;
    tool->point_count = instrument->tip_points;
    tip_points(tool->point_m, instrument->tip_points, instrument->tip_radius_m);
    return STATUS_OK;
}

void scene_contact(const struct scene *scene, double median_compliance_m_N, struct bank_contact *contact)
{
    double stiffness = INFINITY, damping = INFINITY, force = INFINITY;
    for (size_t i = 0; i < scene->instrument_count; i++) {
        const struct scene_instrument *instrument = &scene->instrument[i];
        const struct device_model *device = device_model_find(instrument->device);
        struct scene_coupling used;
        scene_coupling(instrument, device, &used);
        stiffness = smaller(stiffness, used.stiffness_N_m);
        damping = smaller(damping, used.damping_Ns_m);
        force = smaller(force, instrument->force_limit_N > 0 ? instrument->force_limit_N : device->force_limit_N);
    }
    *contact = (struct bank_contact){
        .regularisation_m_N = (float)(scene->regularisation * median_compliance_m_N),
        .coupling_stiffness_N_m = (float)stiffness,
        .coupling_damping_Ns_m = (float)damping,
        .force_limit_N = (float)force,
        .force_rate_N_s = (float)(force / RISE_s),
        .decay_s = (float)DECAY_s,
        .typical_compliance_m_N = (float)median_compliance_m_N,
        .solver_steps = scene->solver_steps,
    };
}
