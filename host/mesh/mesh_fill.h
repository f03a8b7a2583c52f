/* Filling a closed surface with tetrahedra: the program trocar-mesher does it with Gmsh, as a child process, because Gmsh is
 * large and may end or hang the process it runs in. The child is found beside the running program, or where TROCAR_MESHER
 * says; it may take TROCAR_MESHER_SECONDS (default 900).
 *
 *   trocar-mesher surface SIZE         standard input: struct fill_head, then vertices (3 double each), triangles
 *                                      (3 uint32_t each), the shell of each triangle (uint32_t), per shell the shell
 *                                      whose cavity it is or -1 (int32_t)
 *   trocar-mesher geometry SIZE FILE   FILE is a Gmsh geometry script (.geo)
 *
 * writes Gmsh 2.2 text to standard output and ends with 0; otherwise its last line on standard error, behind
 * "trocar-mesher: ", is the reason. Input and output are memory files: nothing is left behind however either side ends, and
 * the child dies with its parent. */
#ifndef TROCAR_MESH_FILL_H
#define TROCAR_MESH_FILL_H

#include <stdint.h>
#include <stdio.h>

#include "mesh.h"

enum { FILL_MAGIC = 0x4c464d54 };

struct fill_head {
    uint32_t magic, shells;
    uint64_t vertices, triangles;
};

/* Gmsh 2.2 text of a mesh (mesh_write_msh writes the same into a file). */
void mesh_print_msh(const struct mesh *mesh, FILE *out);

#endif
