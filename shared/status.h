/* Named results, shared by the controller and the host. 0 or positive is success, negative is a named error whose number
 * is frozen. The one table is status.def. */
#ifndef TROCAR_STATUS_H
#define TROCAR_STATUS_H

enum status {
#define STATUS(name, number, exit_code, meaning, remedy) STATUS_##name = (number),
#include "status.def"
#undef STATUS
};

#endif
