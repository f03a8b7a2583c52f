/* What verbs that run something are given: a bank, or a scene whose bank is then built first. */
#ifndef TROCAR_OPEN_BANK_H
#define TROCAR_OPEN_BANK_H

#include <stdbool.h>

#include "bank.h"

/* By its name: .yaml or .yml. */
bool is_scene(const char *path);

/* Load the bank at `path`; or read the scene there, build its bank into `out_path` (NULL: a temporary file that is gone on
 * return) with progress on stderr when that is a terminal, and load it. */
int open_bank(const char *path, const char *out_path, struct bank_file *bank, struct failure *why);

#endif
