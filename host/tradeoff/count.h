/* Instructions of a tick, counted: the native controller (build/firmware/native/controller.elf: the firmware's objects as a
 * process) runs in lockstep on a recording under valgrind's callgrind, which counts while the function tick() is on the
 * stack and writes a sum after each. These are instructions of this machine's processor, as GCC makes them at -O2; other
 * processors differ by tens of per cent, the comparison between settings hardly does. */
#ifndef TROCAR_COUNT_H
#define TROCAR_COUNT_H

#include <stdbool.h>

#include "recording.h"

struct count {
    bool known;
    char reason[200]; /* why it is not */
    double mean, max; /* per tick in contact */
};

/* `controller`: the program; NULL: firmware/native/controller.elf beside this program, or firmware/native/all/controller.elf
 * for a bank that names `effects`. `folder` takes callgrind's files.
 * `contacts`: per tick, of the replay on the same bank. A tool that is missing is no failure: then it is not known. */
int count_instructions(const char *bank_path, bool effects, const struct recording *recording, const uint8_t *contacts,
                       const char *controller, const char *folder, struct count *count, struct failure *why);

#endif
