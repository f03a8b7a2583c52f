#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "mesh_fill.h"
#include "progress.h"

static bool named(const struct mesh *mesh)
{
    for (size_t i = 0; i < mesh->label_count; i++)
        if (mesh->label[i].name[0])
            return true;
    return false;
}

static void put_names(FILE *out, const struct mesh *mesh)
{
    size_t count = 0;
    for (size_t i = 0; i < mesh->label_count; i++)
        count += mesh->label[i].name[0] != 0;
    fprintf(out, "$PhysicalNames\n%zu\n", count);
    for (size_t i = 0; i < mesh->label_count; i++)
        if (mesh->label[i].name[0])
            fprintf(out, "3 %" PRId32 " \"%s\"\n", mesh->label[i].number, mesh->label[i].name);
    fputs("$EndPhysicalNames\n", out);
}

void mesh_print_msh(const struct mesh *mesh, FILE *out)
{
    fputs("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n", out);
    if (named(mesh))
        put_names(out, mesh);
    fprintf(out, "$Nodes\n%zu\n", mesh->node_count);
    for (size_t i = 0; i < mesh->node_count; i++)
        fprintf(out, "%zu %.17g %.17g %.17g\n", i + 1, mesh->nodes[3 * i], mesh->nodes[3 * i + 1],
                mesh->nodes[3 * i + 2]);
    fprintf(out, "$EndNodes\n$Elements\n%zu\n", mesh->tetrahedron_count);
    for (size_t e = 0; e < mesh->tetrahedron_count; e++) {
        const uint32_t *corner = mesh->tetrahedra + 4 * e;
        fprintf(out, "%zu 4 2 %" PRId32 " 1 %u %u %u %u\n", e + 1, mesh->labels[e], corner[0] + 1, corner[1] + 1,
                corner[2] + 1, corner[3] + 1);
    }
    fputs("$EndElements\n", out);
}

int mesh_write_msh(const struct mesh *mesh, const char *path, struct failure *why)
{
    char *bytes = NULL;
    size_t length = 0;
    FILE *out = open_memstream(&bytes, &length);
    if (!out)
        return failure_set(why, STATUS_MEMORY, path, NULL, "no memory to write the mesh");
    mesh_print_msh(mesh, out);
    bool bad = ferror(out) != 0;
    bad |= fclose(out) != 0;
    int status = bad ? failure_set(why, STATUS_MEMORY, path, NULL, "no memory to write the mesh")
                     : file_replace(path, bytes, length, why);
    free(bytes);
    return status;
}
