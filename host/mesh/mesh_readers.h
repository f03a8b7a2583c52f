/* The readers of volume formats, one file each (read_NAME.c). Each parses the whole file behind `s` (which carries the
 * path, the bytes and the failure) into the empty `mesh`, or fails with the line or byte; the caller frees the mesh
 * then. Quadratic tetrahedra keep their corners. Points, lines, triangles and quadrangles are counted and ignored;
 * other volume elements are refused. */
#ifndef TROCAR_MESH_READERS_H
#define TROCAR_MESH_READERS_H

#include "mesh.h"
#include "mesh_scan.h"

/* The end of `path` is `extension` (".msh"), in either case of letters. */
bool mesh_has_extension(const char *path, const char *extension);

/* Gmsh 1 ($NOD/$ELM), 2.x and 4.1, ASCII and binary. Labels are physical groups.
 * https://gmsh.info/doc/texinfo/gmsh.html, "MSH file format". */
int read_gmsh(struct scan *s, struct mesh *mesh);

#endif
