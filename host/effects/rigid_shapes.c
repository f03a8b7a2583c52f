#include "rigid_shapes.h"

size_t rigid_shapes(const struct bank_view *bank, struct rigid_shape shape[RIGID_SHAPES_MAX])
{
    const struct bank_rigid *b = bank->rigid;
    size_t count = 0;
    if (!b)
        return 0;
    const struct bank_obstacle *obstacle = (const void *)(b + 1);
    for (uint32_t i = 0; i < b->obstacles; i++)
        shape[count++] = (struct rigid_shape){.kind = RIGID_SHAPE_OBSTACLE,
                                              .radius_m = (double)obstacle[i].radius_m,
                                              .point_m = obstacle[i].point_m,
                                              .points = obstacle[i].points};
    for (unsigned t = 0; t < bank->tool_count; t++) {
        double inside = (double)b->cannula_inside_m;
        if (b->cannula_radius_m > 0)
            shape[count++] = (struct rigid_shape){
                .kind = RIGID_SHAPE_CANNULA, .radius_m = (double)b->cannula_radius_m, .instrument = t, .to_m = inside};
        shape[count++] = (struct rigid_shape){.kind = RIGID_SHAPE_SHAFT,
                                              .radius_m = (double)b->shaft_radius_m[t],
                                              .instrument = t,
                                              .from_m = inside,
                                              .to_m = INFINITY};
        if (bank->tools[t].tip_radius_m > b->shaft_radius_m[t])
            shape[count++] = (struct rigid_shape){.kind = RIGID_SHAPE_TIP,
                                                  .radius_m = (double)bank->tools[t].tip_radius_m,
                                                  .instrument = t,
                                                  .from_m = INFINITY,
                                                  .to_m = INFINITY};
    }
    return count;
}
