/* sizes [linear] [quadratic] [MESH...]: bytes of the whole bank per surface vertex at a force error of 1, 0.5 and 0.1 % (p95 of
 * patches), with the other errors beside. The step is searched with one seed of contacts, the errors are measured with
 * another (compression.h). Without arguments: both orders, and the two livers of the project's data that are there. `make
 * sizes`. */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "bank.h"

#define EXTENT_M 0.214

static int line(const char *mesh, enum element_order order, double force_error, struct failure *why)
{
    static struct scene scene;
    char out[] = "/tmp/trocar-sizes-XXXXXX";
    int file = mkstemp(out);
    if (file < 0)
        return failure_set(why, STATUS_FILE_WRITE, out, NULL, "cannot be made");
    close(file);
    scene_assume(mesh, EXTENT_M, MESH_UNIT_NONE, &scene);
    scene.order = order;
    struct compression wanted = {.force_error = force_error};
    struct build_result r;
    int status = bank_build(&scene, out, &wanted, INFINITY, true, &r, why);
    unlink(out);
    if (status)
        return status;
    const char *name = strrchr(mesh, '/');
    const struct error_figures *e = r.error.of;
    printf("%-28s %-9s %6zu %5.1f %7.1f %8.3f %8.3f %8.3f %8.3f\n", name ? name + 1 : mesh,
           order == ELEMENT_LINEAR ? "linear" : "quadratic", (size_t)r.surface_nodes, 100 * force_error,
           (double)r.bytes / (double)r.surface_nodes, 100 * e[COMPRESSION_ERROR_PATCH].p95,
           100 * e[COMPRESSION_ERROR_ONE].p95, 100 * e[COMPRESSION_ERROR_TWO].p95,
           100 * e[COMPRESSION_ERROR_FIELD].p95);
    fflush(stdout);
    return STATUS_OK;
}

int main(int argc, char **argv)
{
    static const double errors[] = {0.01, 0.005, 0.001};
    static const char *const livers[] = {"liver_smooth_1665_6691.msh", "liver_smooth_6267_29596.msh"};
    const char *data = getenv("TROCAR_DATA"), *mesh[16];
    char path[2][600];
    bool wanted[2] = {false, false};
    int meshes = 0;
    for (int k = 1; k < argc && meshes < 16; k++)
        if (strcmp(argv[k], "linear") == 0 || strcmp(argv[k], "quadratic") == 0)
            wanted[argv[k][0] == 'q'] = true;
        else
            mesh[meshes++] = argv[k];
    bool given = meshes > 0;
    for (int k = 0; k < 2 && !given; k++) {
        snprintf(path[k], sizeof path[k], "%s/%s", data ? data : "../shared/data", livers[k]);
        if (access(path[k], R_OK) == 0)
            mesh[meshes++] = path[k];
        else
            printf("%s is not here\n", path[k]);
    }
    printf("%-28s %-9s %6s %5s %7s %8s %8s %8s %8s\n", "mesh", "elements", "vert.", "%", "B/vert.", "patch", "one",
           "two", "field");
    for (int order = 0; order < 2; order++)
        for (int m = 0; m < meshes; m++)
            for (size_t e = 0; e < sizeof errors / sizeof errors[0]; e++) {
                struct failure why = {0};
                if (wanted[0] + wanted[1] == 1 && !wanted[order])
                    continue;
                if (line(mesh[m], order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR, errors[e], &why)) {
                    failure_print(stderr, &why);
                    return 1;
                }
            }
    return 0;
}
