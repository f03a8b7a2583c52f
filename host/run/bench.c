#include "bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "collide.h"

#define REFERENCE_DEVICE "impulse-engine"

int bench_device(const char *name, const struct bank_tool *tool, struct device_model *model, struct failure *why)
{
    const struct device_model *known = device_model_find(name ? name : REFERENCE_DEVICE);
    if (!known)
        return failure_set(why, STATUS_SCENE_VALUE, NULL, NULL, "there is no device \"%.60s\" (known: %s)", name,
                           device_model_names());
    *model = *known;
    for (int k = 0; k < 3; k++) {
        const struct bank_axis *from = &tool->axis[k];
        struct device_axis_model *to = &model->axis[k];
        to->per_count = (double)from->per_count;
        to->zero = (double)from->zero;
        to->count_zero = from->count_zero;
        to->count_modulus = from->count_modulus;
        to->minimum = (double)from->minimum;
        to->maximum = (double)from->maximum;
    }
    model->gravity_N = (double)tool->gravity_N;
    model->gravity_arm_m = (double)tool->gravity_arm_m;
    return STATUS_OK;
}

int bench_choose(const char *name, const struct bank_file *bank, uint32_t tool, struct device_model *model,
                 struct failure *why)
{
    struct scene *scene = name ? NULL : bank_scene(bank);
    if (scene && scene->instrument_count > tool && *scene->instrument[tool].device)
        name = scene->instrument[tool].device;
    int status = bench_device(name, &bank->view.tools[tool], model, why);
    free(scene);
    return status;
}

int bench_hand(const struct bank_view *bank, uint32_t number, struct hand *hand, struct failure *why)
{
    const struct bank_tool *tool = &bank->tools[number];
    double shortest = (double)tool->axis[2].minimum, longest = (double)tool->axis[2].maximum, lead = 0;
    for (uint32_t p = 0; p < tool->point_count; p++)
        lead = fmax(lead, (double)tool->point_m[p][2]);
    float end[3];
    double reach = longest + lead;
    for (int i = 0; i < 3; i++)
        end[i] = tool->trocar_m[i] + (float)reach * tool->rotation[3 * i + 2];
    struct collide_hit hit;
    if (!collide_brute(bank, tool->trocar_m, end, &hit))
        return failure_set(why, STATUS_SCENE_VALUE, NULL, "place the trocar so that its axis points at the body",
                           "the instrument's axis does not meet the body within its range of %.3f m", longest);
    double touch = (double)hit.fraction * reach - lead;
    double start = shortest + 0.02 * (longest - shortest);
    if (touch < start)
        return failure_set(why, STATUS_SCENE_VALUE, NULL, "move the trocar away from the body",
                           "the body is %.3f m from the trocar, nearer than the shortest insertion of %.3f m",
                           touch + lead, shortest);
    *hand = (struct hand){.stiffness_N_m = HAND_STIFFNESS_N_M,
                          .damping_Ns_m = HAND_DAMPING_NS_M,
                          .start = {0, 0, start},
                          .touch = {0, 0, touch}};
    return STATUS_OK;
}

void bench_gravity(const struct bank_tool *tool, double direction[3])
{
    for (int j = 0; j < 3; j++) { /* world to trocar's frame: the transpose */
        direction[j] = 0;
        for (int i = 0; i < 3; i++)
            direction[j] += (double)tool->rotation[3 * i + j] * (double)tool->gravity_direction[i];
    }
}

int bench_start(struct bench_instrument *b, const struct bank_file *bank, uint32_t tool, const char *gesture,
                const char *device, uint8_t node_id, struct failure *why)
{
    const char *name = gesture ? gesture : "press";
    char message[300] = "";
    long line = 0;
    *b = (struct bench_instrument){.driven = false};
    int status = gesture_read(name, &b->gesture, message, sizeof message, &line);
    if (status)
        return failure_at(why, (enum status)status, name, line, NULL, "%s", message);
    status = bench_choose(device, bank, tool, &b->model, why);
    if (!status)
        status = bench_hand(&bank->view, tool, &b->hand, why);
    if (status)
        return status;
    b->hand.gesture = &b->gesture;
    device_node_start(&b->node, &b->model, &b->hand, node_id);
    bench_gravity(&bank->view.tools[tool], b->node.device.gravity_direction);
    return STATUS_OK;
}

void bench_drive(struct bench_instrument *b, bool driven, const double target_m[3], double time_s)
{
    if (driven && !b->driven && !b->hand.overridden)
        hand_target(&b->hand, time_s, b->hand.override_m); /* from where it is */
    b->driven = driven;
    if (driven) {
        memcpy(b->drive_m, target_m, sizeof b->drive_m);
        b->hand.overridden = 1;
    }
}

void bench_drive_tick(struct bench_instrument *b, double time_s)
{
    struct hand *hand = &b->hand;
    double goal[3], distance = 0;
    if (!b->driven && !hand->overridden)
        return;
    hand->overridden = 0;
    hand_target(hand, time_s, goal);
    hand->overridden = 1;
    if (b->driven)
        memcpy(goal, b->drive_m, sizeof goal);
    for (int i = 0; i < 3; i++)
        distance += (goal[i] - hand->override_m[i]) * (goal[i] - hand->override_m[i]);
    distance = sqrt(distance);
    double step = 1e-3 * BENCH_DRIVE_m_s, part = distance > step ? step / distance : 1;
    for (int i = 0; i < 3; i++)
        hand->override_m[i] += part * (goal[i] - hand->override_m[i]);
    if (part == 1 && !b->driven)
        hand->overridden = 0;
}
