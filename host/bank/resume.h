/* What a long build has computed by the time that it is interrupted: the compliance, its longest part, in a file beside the
 * bank, BANK.part. It is written whole or not at all (progress.h), found again by a key of all that the compliance comes from,
 * and removed when the bank is there. Its use changes no bit of the bank.
 *
 * Layout, this machine's byte order: "TRCPART1", the key (32 bytes), rows, vertices (uint64), the median diagonal (double),
 * row_of (uint32 each), the lower half of G by columns (double), CRC-32 of all that. 36 rows^2 bytes. */
#ifndef TROCAR_RESUME_H
#define TROCAR_RESUME_H

#include "bank.h"

enum { RESUME_KEY_BYTES = 32 };

struct resume {
    char path[1100]; /* BANK.part; "" when another kind of file is there: then nothing is kept */
    unsigned char key[RESUME_KEY_BYTES];
};

/* The key: SHA-256 of this program's layout of the file, the scene's text, and the mesh as read (nodes, elements, labels,
 * the last bit of each) with its file's hash. */
int resume_begin(const char *bank_path, const struct body *body, const char *scene_text, struct resume *resume,
                 struct failure *why);

/* Take the compliance from the file. False when there is none, when it is another body's, or when it is damaged: then it has
 * to be computed. */
bool resume_load(const struct resume *resume, const struct body *body, struct compliance *compliance);

/* FILE_WRITE, MEMORY, INTERRUPTED. */
int resume_save(const struct resume *resume, const struct body *body, const struct compliance *compliance,
                struct failure *why);

/* The file exists and has this key. */
bool resume_is_there(const struct resume *resume);

/* Remove the file, if there is one, of whichever body; never another kind of file. */
void resume_end(const struct resume *resume);

#endif
