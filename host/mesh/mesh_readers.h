/* The readers of volume formats, one file each (read_NAME.c). Each parses the whole file behind `s` (which carries the
 * path, the bytes and the failure) into the empty `mesh`, or fails with the line or byte; the caller frees the mesh
 * then. Quadratic tetrahedra keep their corners. Points, lines, triangles and quadrangles are counted and ignored;
 * other volume elements are refused. */
#ifndef TROCAR_MESH_READERS_H
#define TROCAR_MESH_READERS_H

#include "mesh.h"
#include "mesh_scan.h"
#include "triangle_soup.h"

/* The end of `path` is `extension` (".msh"), in either case of letters. */
bool mesh_has_extension(const char *path, const char *extension);

/* Gmsh 1 ($NOD/$ELM), 2.x and 4.1, ASCII and binary. Labels are physical groups.
 * https://gmsh.info/doc/texinfo/gmsh.html, "MSH file format". */
int read_gmsh(struct scan *s, struct mesh *mesh);

/* Legacy VTK and VTK XML hold a volume (then `mesh` is filled) or a surface (then `soup`). The label is the cell array named
 * material, label, region ..., else one of few whole numbers. */
int read_vtk(struct scan *s, struct mesh *mesh, struct soup *soup, bool *is_surface);
int read_vtk_xml(struct scan *s, struct mesh *mesh, struct soup *soup, bool *is_surface);

/* TetGen: `s` is the file given, .node or .ele; the other is found beside it. Numbers start at 0 or 1; the attribute of an
 * element is its label. https://wias-berlin.de/software/tetgen/fformats.html */
int read_tetgen(struct scan *s, struct mesh *mesh);

/* Vega: VERTICES, ELEMENTS (TET), MATERIAL, SET, REGION; *INCLUDE files stand beside the file. The label of an element is the
 * number of its region's material, in the file's order from 1, and carries its name. */
int read_vega(struct scan *s, struct mesh *mesh);

/* Surfaces. */
int read_stl(struct scan *s, struct soup *soup);
int read_obj(struct scan *s, struct soup *soup);
int read_ply(struct scan *s, struct soup *soup);

/* Fill a closed surface with tetrahedra by the mesher, of element size `size` (0: keep the triangles); or run it on a Gmsh
 * geometry script. See trocar-mesher_main.c. */
int mesh_fill(const struct soup *soup, double size, const char *path, struct mesh *mesh, struct failure *why);
int mesh_geometry(double size, const char *path, struct mesh *mesh, struct failure *why);

#endif
