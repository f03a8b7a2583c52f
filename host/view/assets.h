/* The page's files, built into the program: no file is read when it runs, nothing comes from a network. three.js and its
 * OrbitControls are Debian's libjs-three (r111). */
#ifndef TROCAR_ASSETS_H
#define TROCAR_ASSETS_H

#include <stddef.h>

struct asset {
    const char *path; /* of the request: "/", "/view.js", ... */
    const char *type; /* Content-Type */
    const unsigned char *bytes;
    size_t length;
};

/* NULL for a path that the page does not have. */
const struct asset *asset_find(const char *path);

#endif
