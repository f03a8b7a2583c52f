/* The controller's loop on the driver of ST's FDCAN controller. */
#include "fdcan_driver.h"

#include "driver_loop.h"

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {DRIVER_LOOP_CASES};
    return cmocka_run_group_tests_name("the loop on the FDCAN driver", tests, NULL, NULL);
}
