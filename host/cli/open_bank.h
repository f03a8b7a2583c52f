/* What verbs are given, a bank, or a scene whose bank is then built first; and where they may write one. */
#ifndef TROCAR_OPEN_BANK_H
#define TROCAR_OPEN_BANK_H

#include <stdbool.h>

#include "bank.h"

/* By its name: .yaml or .yml, in either case of letters. */
bool is_scene(const char *path);

/* FILE_WRITE when a bank at `out_path` would overwrite an input of this build (the file named on the command line, the scene,
 * its mesh; of TetGen's pair the other file too) or something that is not a bank. */
int check_bank_output(const char *out_path, const char *input, const struct scene *scene, struct failure *why);

/* bank_load; what is a mesh or a scene instead is answered with the command that builds its bank. */
int load_bank(const char *path, struct bank_file *bank, struct failure *why);

/* Load the bank at `path`; or read the scene there, build its bank into `out_path` (NULL: a temporary file that is gone on
 * return) with progress on stderr when that is a terminal, and load it. Warnings of the build go to stderr. */
int open_bank(const char *path, const char *out_path, struct bank_file *bank, struct failure *why);

#endif
