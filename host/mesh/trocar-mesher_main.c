/* Tetrahedra by Gmsh's C API; mesh_fill.h is the manual. Gmsh prints wherever it likes: standard output is set aside before
 * it starts. */
#include <errno.h>
#include <gmshc.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "mesh_fill.h"
#include "mesh_repair.h"

enum { LINE = 1, TRIANGLE = 2, TETRAHEDRON = 4 }; /* Gmsh's element types */

struct input {
    struct fill_head head;
    double *vertices;
    uint32_t *triangles, *shell;
    int32_t *inside;
};

__attribute__((noreturn)) static void fail(const char *reason)
{
    char line[400];
    snprintf(line, sizeof line, "%s", reason);
    for (char *c = line; *c; c++)
        if (*c == '\n')
            *c = ' ';
    fprintf(stderr, "trocar-mesher: %s\n", line);
    fflush(stderr);
    _exit(1); /* Gmsh's own cleaning up after an error is not to be trusted */
}

static void check(int error, const char *step)
{
    char reason[400], *text = NULL;
    int ignored;
    if (!error)
        return;
    gmshLoggerGetLastError(&text, &ignored);
    snprintf(reason, sizeof reason, "Gmsh failed while %s: %s", step, text && *text ? text : "no reason given");
    fail(reason);
}

static void *take(size_t count, size_t each)
{
    void *list = malloc((count ? count : 1) * each);
    if (!list)
        fail("no memory for the surface");
    if (fread(list, each, count, stdin) != count)
        fail("the surface on standard input is cut short");
    return list;
}

static struct input read_surface(void)
{
    struct input in;
    if (fread(&in.head, sizeof in.head, 1, stdin) != 1 || in.head.magic != FILL_MAGIC ||
        in.head.vertices > UINT32_MAX || in.head.triangles > UINT32_MAX || in.head.shells > 256 || in.head.shells < 1)
        fail("standard input holds no surface");
    in.vertices = take(in.head.vertices, 3 * sizeof *in.vertices);
    in.triangles = take(in.head.triangles, 3 * sizeof *in.triangles);
    in.shell = take(in.head.triangles, sizeof *in.shell);
    in.inside = take(in.head.shells, sizeof *in.inside);
    for (size_t i = 0; i < 3 * in.head.triangles; i++)
        if (in.triangles[i] >= in.head.vertices || in.shell[i / 3] >= in.head.shells)
            fail("the surface on standard input is not consistent");
    return in;
}

/* One discrete surface per shell; node tag = vertex + 1, surface tag = shell + 1. */
static void add_shells(const struct input *in)
{
    size_t vertices = in->head.vertices, triangles = in->head.triangles;
    bool *added = calloc(vertices, sizeof *added);
    size_t *tags = malloc(vertices * sizeof *tags), *corners = malloc(3 * triangles * sizeof *corners);
    double *x = malloc(3 * vertices * sizeof *x);
    if (!added || !tags || !corners || !x)
        fail("no memory for the surface");
    for (uint32_t shell = 0; shell < in->head.shells; shell++) {
        int error;
        size_t nodes = 0, used = 0;
        for (size_t i = 0; i < 3 * triangles; i++) {
            uint32_t v = in->triangles[i];
            if (in->shell[i / 3] != shell)
                continue;
            corners[used++] = v + 1u;
            if (added[v])
                continue;
            added[v] = true;
            memcpy(x + 3 * nodes, in->vertices + 3 * (size_t)v, 3 * sizeof *x);
            tags[nodes++] = v + 1u;
        }
        gmshModelAddDiscreteEntity(2, (int)shell + 1, NULL, 0, &error);
        check(error, "taking the surface");
        gmshModelMeshAddNodes(2, (int)shell + 1, tags, nodes, x, 3 * nodes, NULL, 0, &error);
        check(error, "taking the surface's vertices");
        gmshModelMeshAddElementsByType((int)shell + 1, TRIANGLE, NULL, 0, corners, used, &error);
        check(error, "taking the surface's triangles");
    }
    free(added);
    free(tags);
    free(corners);
    free(x);
}

/* Which shell a surface belongs to after Gmsh cut the shells into patches: its nodes keep their tags. */
static uint32_t shell_of(const struct input *in, int surface)
{
    size_t *elements, *corners, element_count, corner_count;
    int error;
    gmshModelMeshGetElementsByType(TRIANGLE, &elements, &element_count, &corners, &corner_count, surface, 0, 1, &error);
    check(error, "reading the patches");
    for (size_t t = 0; corner_count && t < in->head.triangles; t++) {
        size_t same = 0;
        for (int k = 0; k < 3; k++)
            for (int j = 0; j < 3; j++)
                same += in->triangles[3 * t + (size_t)k] + 1u == corners[j];
        if (same == 3)
            return in->shell[t];
    }
    fail("Gmsh made a patch that is not of the surface");
}

/* A volume for each shell that bounds a body, with its cavities. */
static void add_volumes(const struct input *in)
{
    int *entity, error, loop[256], list[257];
    size_t entities;
    gmshModelGetEntities(&entity, &entities, 2, &error);
    check(error, "listing the surfaces");
    int *patch = malloc((entities + 1) * sizeof *patch);
    uint32_t *shell = malloc((entities + 1) * sizeof *shell);
    if (!patch || !shell)
        fail("no memory for the patches");
    for (size_t i = 0; i < entities / 2; i++)
        shell[i] = shell_of(in, entity[2 * i + 1]);
    for (uint32_t s = 0; s < in->head.shells; s++) {
        size_t patches = 0;
        for (size_t i = 0; i < entities / 2; i++)
            if (shell[i] == s)
                patch[patches++] = entity[2 * i + 1];
        loop[s] = gmshModelGeoAddSurfaceLoop(patch, patches, -1, &error);
        check(error, "closing a shell");
    }
    for (uint32_t s = 0; s < in->head.shells; s++) {
        size_t loops = 0;
        if (in->inside[s] >= 0)
            continue;
        list[loops++] = loop[s];
        for (uint32_t cavity = 0; cavity < in->head.shells; cavity++)
            if (in->inside[cavity] == (int32_t)s)
                list[loops++] = loop[cavity];
        gmshModelGeoAddVolume(list, loops, -1, &error);
        check(error, "making a volume");
    }
    gmshModelGeoSynchronize(&error);
    check(error, "making the volumes");
    free(patch);
    free(shell);
    gmshFree(entity);
}

static void set(const char *option, double value)
{
    int error;
    gmshOptionSetNumber(option, value, &error);
    check(error, option);
}

static void use_size(double size)
{
    if (size > 0) {
        set("Mesh.CharacteristicLengthMin", size);
        set("Mesh.CharacteristicLengthMax", size);
    }
}

/* The label of a volume is its first physical group; where there are groups, volumes without one are left out, as Gmsh does
 * when it saves. */
static int label_of(int volume)
{
    int *group, error, label;
    size_t groups;
    gmshModelGetPhysicalGroupsForEntity(3, volume, &group, &groups, &error);
    check(error, "listing the physical groups");
    label = groups ? group[0] : 0;
    gmshFree(group);
    return label;
}

static void collect_nodes(struct mesh *mesh, uint32_t **place, size_t *places)
{
    size_t *tags, count, n, none;
    double *x, *parameters;
    int error;
    gmshModelMeshGetNodes(&tags, &count, &x, &n, &parameters, &none, -1, -1, 0, 0, &error);
    check(error, "reading the nodes");
    for (size_t i = *places = 0; i < count; i++)
        *places = tags[i] >= *places ? tags[i] + 1 : *places;
    *place = malloc((*places + 1) * sizeof **place);
    mesh->nodes = x;
    mesh->node_count = count;
    if (!*place)
        fail("no memory for the nodes");
    for (size_t i = 0; i < count; i++)
        (*place)[tags[i]] = (uint32_t)i;
    gmshFree(tags);
    gmshFree(parameters);
}

static void collect_names(struct mesh *mesh)
{
    int *group, error;
    size_t groups;
    gmshModelGetPhysicalGroups(&group, &groups, 3, &error);
    check(error, "listing the physical groups");
    mesh->label = calloc(groups / 2 + 1, sizeof *mesh->label);
    if (!mesh->label)
        fail("no memory for the physical groups");
    for (size_t i = 0; i < groups / 2; i++) {
        char *name = NULL;
        gmshModelGetPhysicalName(3, group[2 * i + 1], &name, &error);
        mesh->label[i].number = group[2 * i + 1];
        if (name)
            snprintf(mesh->label[i].name, sizeof mesh->label[i].name, "%s", name);
    }
    mesh->label_count = groups / 2;
}

static struct mesh collect(void)
{
    struct mesh mesh = {0};
    uint32_t *place;
    size_t places, volumes;
    int *volume, error;
    collect_nodes(&mesh, &place, &places);
    collect_names(&mesh);
    gmshModelGetEntities(&volume, &volumes, 3, &error);
    check(error, "listing the volumes");
    for (size_t i = 0; i < volumes / 2; i++) {
        size_t *elements, count, *corners, corner_count, kinds;
        int tag = volume[2 * i + 1], *kind, label = label_of(tag);
        gmshModelMeshGetElementTypes(&kind, &kinds, 3, tag, &error);
        check(error, "reading the elements");
        if (kinds > 1 || (kinds == 1 && kind[0] != TETRAHEDRON))
            fail("the geometry script asks for elements that are not tetrahedra");
        if (kinds == 0)
            fail("Gmsh left a volume empty");
        if (label == 0 && mesh.label_count)
            continue;
        gmshModelMeshGetElementsByType(TETRAHEDRON, &elements, &count, &corners, &corner_count, tag, 0, 1, &error);
        check(error, "reading the tetrahedra");
        size_t total = mesh.tetrahedron_count + count;
        mesh.tetrahedra = realloc(mesh.tetrahedra, (total + 1) * 4 * sizeof *mesh.tetrahedra);
        mesh.labels = realloc(mesh.labels, (total + 1) * sizeof *mesh.labels);
        if (!mesh.tetrahedra || !mesh.labels)
            fail("no memory for the tetrahedra");
        for (size_t k = 0; k < corner_count; k++)
            mesh.tetrahedra[4 * mesh.tetrahedron_count + k] = place[corners[k]];
        for (size_t k = 0; k < count; k++)
            mesh.labels[mesh.tetrahedron_count + k] = label;
        mesh.tetrahedron_count = total;
        gmshFree(elements);
        gmshFree(corners);
    }
    if (mesh.tetrahedron_count == 0)
        fail("Gmsh made no tetrahedron: the geometry has no volume");
    free(place);
    struct mesh_report ignored = {0};
    struct failure why;
    if (mesh_repair(&mesh, &ignored, &why) != 0) /* nodes of curves and points that belong to no volume */
        fail(why.cause);
    return mesh;
}

/* One way to fill the surface. `angle_deg`: edges sharper than this become borders of the patches into which Gmsh cuts the
 * surface to remesh it; 0 keeps the triangles. */
static void fill_once(const struct input *in, double size, double angle_deg)
{
    int error;
    double pi = acos(-1);
    gmshModelAdd("surface", &error);
    check(error, "starting");
    add_shells(in);
    if (angle_deg > 0) {
        gmshModelMeshClassifySurfaces(angle_deg * pi / 180, 1, 1, pi, 1, &error);
        check(error, "cutting the surface into patches");
        gmshModelMeshCreateGeometry(NULL, 0, &error);
        check(error, "unrolling the surface");
        use_size(size);
    } else {
        gmshModelMeshCreateTopology(0, 1, &error);
        check(error, "taking the surface");
    }
    add_volumes(in);
    gmshModelMeshGenerate(3, &error);
    check(error, "filling the surface");
}

static double shortest_edge(const struct mesh *mesh)
{
    double shortest = INFINITY;
    for (size_t e = 0; e < mesh->tetrahedron_count; e++) {
        double length[6];
        tetrahedron_edges(mesh, e, length);
        for (int i = 0; i < 6; i++)
            shortest = fmin(shortest, length[i]);
    }
    return shortest;
}

static struct mesh mesh_script(double size, const char *path)
{
    int error;
    gmshOpen(path, &error);
    check(error, "reading the geometry");
    use_size(size);
    set("Mesh.ElementOrder", 1);
    gmshModelMeshGenerate(3, &error);
    check(error, "meshing the geometry");
    return collect();
}

static void start_gmsh(void)
{
    int error;
    gmshInitialize(0, NULL, 0, &error);
    check(error, "starting");
    set("General.Terminal", 0);
    set("General.NumThreads", 1);
    set("Mesh.OptimizeThreshold", 0.5); /* 0.3 by itself: slivers cost the solver digits, and time here is little */
    gmshLoggerStart(&error);
}

static void print(const struct mesh *mesh, int file)
{
    FILE *stream = fdopen(file, "w");
    if (!stream)
        fail("no standard output");
    mesh_print_msh(mesh, stream);
    bool bad = ferror(stream) != 0;
    if (fclose(stream) != 0 || bad)
        fail("the mesh could not be written");
}

enum { GOOD = 0, FAILED = 1, TINY = 2 };

/* Ends the process with one of these. */
__attribute__((noreturn)) static void attempt(double size, double angle_deg, int file)
{
    static const double tiny = 0.05;
    start_gmsh();
    struct input in = read_surface();
    fill_once(&in, size, angle_deg);
    struct mesh mesh = collect();
    print(&mesh, file);
    _exit(angle_deg > 0 && shortest_edge(&mesh) < tiny * size ? TINY : GOOD);
}

static void copy(int from, int to)
{
    char block[1 << 16];
    ssize_t n;
    lseek(from, 0, SEEK_SET);
    while ((n = read(from, block, sizeof block)) > 0)
        if (write(to, block, (size_t)n) != n)
            fail("the mesh could not be written");
}

/* Remeshing keeps sharp edges if it can (40 degrees), but on organic shapes that scatters borders, between which patches do
 * not unroll or triangles become tiny: then fewer borders are tried, and the first mesh without tiny edges is taken, else
 * the first mesh. Each attempt is a process, as Gmsh does not start afresh after an error. */
static void remesh(double size, int out)
{
    static const double angle_deg[] = {40, 90, 180};
    int kept = -1;
    for (int i = 0; i < 3; i++) {
        int file = memfd_create("attempt", MFD_CLOEXEC), ended = 0;
        pid_t parent = getpid(), child = file < 0 || lseek(STDIN_FILENO, 0, SEEK_SET) != 0 ? -1 : fork();
        if (child < 0)
            fail("no attempt can be started");
        if (child == 0) {
            prctl(PR_SET_PDEATHSIG, SIGKILL);
            if (getppid() == parent)
                attempt(size, angle_deg[i], file);
            _exit(FAILED);
        }
        while (waitpid(child, &ended, 0) < 0 && errno == EINTR)
            ;
        bool made = WIFEXITED(ended) && WEXITSTATUS(ended) != FAILED;
        if (WIFSIGNALED(ended))
            fprintf(stderr, "trocar-mesher: Gmsh was ended by signal %d while remeshing\n", WTERMSIG(ended));
        if (made && (kept < 0 || WEXITSTATUS(ended) == GOOD)) {
            kept = file;
            if (WEXITSTATUS(ended) == GOOD)
                break;
        }
    }
    if (kept < 0)
        _exit(FAILED); /* the last attempt has said why */
    copy(kept, out);
}

int main(int argc, char **argv)
{
    bool script = argc == 4 && strcmp(argv[1], "geometry") == 0;
    if (!script && !(argc == 3 && strcmp(argv[1], "surface") == 0))
        fail("usage: trocar-mesher surface SIZE < SURFACE, or trocar-mesher geometry SIZE FILE.geo");
    double size = strtod(argv[2], NULL);
    int out = dup(STDOUT_FILENO);
    if (out < 0 || dup2(STDERR_FILENO, STDOUT_FILENO) < 0)
        fail("no standard output");
    if (!script && size > 0) {
        remesh(size, out);
    } else if (!script) {
        attempt(0, 0, out);
    } else {
        start_gmsh();
        struct mesh mesh = mesh_script(size, argv[3]);
        print(&mesh, out);
    }
    _exit(0);
}
