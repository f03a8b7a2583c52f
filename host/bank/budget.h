/* What a bank may cost, from the scene's budget (trocar build --max-... sets it): bytes of the file, instructions of the
 * worst tick (worst_tick.h), force error (p95 of patches, compression_error.h). The best bank within them has the least force
 * error; when only the error is limited, the least bytes. Turned are only the step of the compression (compression.h), plain
 * storage when that fits, and the share of a tick that decodes rows (CONT row_work); the mesh, the tool's points and the
 * solver's steps stay what the scene says. STATUS_BANK_LIMIT says which limit cannot be met, by how much, and the nearest
 * that can. */
#ifndef TROCAR_BUDGET_H
#define TROCAR_BUDGET_H

#include "bank_format.h"
#include "compression.h"
#include "failure.h"
#include "pack.h"
#include "scene.h"

/* Complete `wanted` before the long computation: the scene's limits, and whether a plain bank keeps them. `provenance_bytes`:
 * of section PROV at most. Refuses instructions that no bank of this scene can keep, and a plain bank that is too large. */
int budget_begin(const struct scene *scene, const struct pack *pack, double provenance_bytes,
                 struct compression *wanted, struct failure *why);

/* Set the contact record's row_work for the scene's instructions; *worst: of a tick with it. */
int budget_instructions_fit(const struct scene *scene, const struct compressed *compressed,
                            struct bank_contact *contact, double *worst, struct failure *why);

#endif
