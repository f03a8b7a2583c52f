/* trocar mesh FILE: read, repair, measure and judge a mesh. */
#include <getopt.h>
#include <json-c/json.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "cli.h"
#include "mesh.h"
#include "output.h"

static const char usage[] =
    "usage: trocar mesh FILE [--extent METRES | --unit m|cm|mm] [--size SIZE] [--json] [-o OUT.msh]\n"
    "\n"
    "Reads Gmsh 1, 2 and 4.1, VTK, VTU, TetGen and Vega volumes; closed STL, OBJ, PLY and VTP surfaces and Gmsh "
    "geometry\n"
    "scripts (.geo) are filled with tetrahedra. Prints counts, extent, volume, edges, angles, repairs and a verdict.\n"
    "\n"
    "  -e, --extent METRES   scale the longest side to this\n"
    "  -u, --unit UNIT       the file's length unit: m, cm or mm\n"
    "  -s, --size SIZE       remesh a surface at this element size, in the file's unit\n"
    "  -o, --output FILE     write the repaired mesh as Gmsh 2.2\n"
    "  -j, --json            one JSON object on stdout\n"
    "\n"
    "Without --extent or --unit all lengths are in the file's own unit. Exit code 0 if the mesh is usable, with or "
    "without\n"
    "warnings.\n";

struct options {
    const char *path, *output;
    double extent_m, size;
    enum mesh_unit unit;
    bool json, help;
};

static int parse(int argc, char **argv, struct options *o, struct failure *why)
{
    static const struct option options[] = {{"extent", required_argument, NULL, 'e'},
                                            {"unit", required_argument, NULL, 'u'},
                                            {"size", required_argument, NULL, 's'},
                                            {"output", required_argument, NULL, 'o'},
                                            {"json", no_argument, NULL, 'j'},
                                            {"help", no_argument, NULL, 'h'},
                                            {NULL, 0, NULL, 0}};
    int option, status = STATUS_OK;
    optind = 1;
    opterr = 0;
    while (status == STATUS_OK && (option = getopt_long(argc, argv, ":e:u:s:o:jh", options, NULL)) != -1) {
        switch (option) {
        case 'e':
            status = cli_positive("--extent", optarg, &o->extent_m, why);
            break;
        case 'u':
            o->unit = !strcmp(optarg, "m")    ? MESH_UNIT_M
                      : !strcmp(optarg, "cm") ? MESH_UNIT_CM
                      : !strcmp(optarg, "mm") ? MESH_UNIT_MM
                                              : MESH_UNIT_NONE;
            if (o->unit == MESH_UNIT_NONE)
                status = failure_set(why, STATUS_USAGE, NULL, NULL, "--unit takes m, cm or mm, not \"%.20s\"", optarg);
            break;
        case 's':
            status = cli_positive("--size", optarg, &o->size, why);
            break;
        case 'o':
            o->output = optarg;
            break;
        case 'j':
            o->json = true;
            break;
        case 'h':
            o->help = true;
            return STATUS_OK;
        default:
            status = cli_bad_option("mesh", option, argv, why);
        }
    }
    if (status)
        return status;
    if (o->extent_m > 0 && o->unit != MESH_UNIT_NONE)
        return failure_set(why, STATUS_USAGE, NULL, "give one of them", "--extent and --unit are both given");
    if (optind + 1 != argc)
        return failure_set(why, STATUS_USAGE, NULL, "see trocar mesh --help",
                           optind == argc ? "no mesh is given" : "more than one mesh is given");
    o->path = argv[optind];
    return STATUS_OK;
}

/* A clause for each thing that a user should know before using this mesh; returns how many. */
static size_t warnings(const struct mesh *mesh, const struct mesh_report *r, char text[8][500])
{
    size_t n = 0;
    if (*mesh->warning)
        snprintf(text[n++], 500, "%s", mesh->warning);
    if (r->dihedral_min_deg < 1 || r->dihedral_max_deg > 179)
        snprintf(text[n++], 500,
                 "slivers: dihedral angles from %.3g to %.5g degrees; the stiffness matrix is badly scaled near them",
                 r->dihedral_min_deg, r->dihedral_max_deg);
    if (r->nonmanifold_edges)
        snprintf(text[n++], 500, "%zu edge%s of the surface ha%s more than two triangles", r->nonmanifold_edges,
                 r->nonmanifold_edges == 1 ? "" : "s", r->nonmanifold_edges == 1 ? "s" : "ve");
    if (r->nonmanifold_vertices)
        snprintf(text[n++], 500, "at %zu vert%s the surface touches itself", r->nonmanifold_vertices,
                 r->nonmanifold_vertices == 1 ? "ex" : "ices");
    if (r->edge_max > 50 * r->edge_min)
        snprintf(text[n++], 500, "edge lengths differ by a factor of %.3g", r->edge_max / r->edge_min);
    return n;
}

static void print_histogram(const struct mesh_report *r)
{
    size_t most = 1, total = 0;
    for (int i = 0; i < 18; i++) {
        total += r->dihedral_histogram[i];
        if (r->dihedral_histogram[i] > most)
            most = r->dihedral_histogram[i];
    }
    puts("dihedral angles, degrees:");
    for (int i = 0; i < 18; i++) {
        size_t n = r->dihedral_histogram[i];
        size_t width = (n * 50 + most - 1) / most; /* at least one mark for at least one angle */
        printf("  %3d..%-3d %8zu %5.1f %%%s%.*s\n", 10 * i, 10 * i + 10, n,
               total ? 100.0 * (double)n / (double)total : 0, width ? "  " : "", (int)width,
               "##################################################");
    }
}

static void print_repair(size_t count, const char *noun, const char *what, bool *any)
{
    if (count)
        printf("%s%zu %s%s %s", *any ? ", " : "repaired: ", count, noun, count == 1 ? "" : "s", what);
    *any = *any || count;
}

static void print_text(const struct mesh *mesh, const struct mesh_report *r, const char *unit)
{
    bool any = false;
    char length[16] = "", cubic[16] = ""; /* with their blank, or nothing */
    if (*unit) {
        snprintf(length, sizeof length, " %s", unit);
        snprintf(cubic, sizeof cubic, " %s3", unit);
    }
    printf("%s: %zu nodes, %zu tetrahedra, surface of %zu vertices and %zu triangles\n", mesh->path, r->nodes,
           r->tetrahedra, r->surface_vertices, r->surface_triangles);
    if (mesh->ignored_elements)
        printf("ignored: %zu points, lines and surface elements\n", mesh->ignored_elements);
    if (r->surface_vertices == 0) /* refused before anything was measured */
        return;
    printf("pieces %zu, genus %zu, labels:", r->components, r->genus);
    for (size_t i = 0; i < mesh->label_count && i < 20; i++)
        printf(" %d%s%s", mesh->label[i].number, *mesh->label[i].name ? " " : "", mesh->label[i].name);
    puts(mesh->label_count > 20 ? " ..." : "");
    printf("extent %.5g x %.5g x %.5g %s, volume %.5g%s\n", r->extent[0], r->extent[1], r->extent[2],
           *unit ? unit : "(in the file's unit, which is not known: --extent or --unit gives it)", r->volume, cubic);
    printf("edges %.4g to %.4g%s, mean %.4g\n", r->edge_min, r->edge_max, length, r->edge_mean);
    printf("angles %.4g to %.4g degrees\n", r->dihedral_min_deg, r->dihedral_max_deg);
    print_histogram(r);
    print_repair(r->reoriented, "element", "reoriented", &any);
    print_repair(r->duplicate_nodes, "duplicate node", "merged", &any);
    print_repair(r->duplicate_elements, "duplicate element", "removed", &any);
    print_repair(r->unused_nodes, "unused node", "dropped", &any);
    puts(any ? "" : "repaired: nothing was needed");
}

static void add(struct json_object *to, const char *key, struct json_object *value)
{
    json_object_object_add(to, key, value);
}

static struct json_object *whole(size_t n)
{
    return json_object_new_int64((int64_t)n);
}

static struct json_object *vector(const double x[3])
{
    struct json_object *list = json_object_new_array();
    for (int k = 0; k < 3; k++)
        json_object_array_add(list, json_object_new_double(x[k]));
    return list;
}

static void add_measures(struct json_object *to, const struct mesh_report *r)
{
    const struct {
        const char *key;
        size_t count;
    } counts[] = {{"nodes", r->nodes},
                  {"tetrahedra", r->tetrahedra},
                  {"surface_vertices", r->surface_vertices},
                  {"surface_triangles", r->surface_triangles},
                  {"reoriented", r->reoriented},
                  {"duplicate_nodes", r->duplicate_nodes},
                  {"duplicate_elements", r->duplicate_elements},
                  {"unused_nodes", r->unused_nodes},
                  {"degenerate", r->degenerate},
                  {"overlapping", r->overlapping},
                  {"nonmanifold_edges", r->nonmanifold_edges},
                  {"nonmanifold_vertices", r->nonmanifold_vertices},
                  {"components", r->components},
                  {"genus", r->genus}};
    for (size_t i = 0; i < sizeof counts / sizeof counts[0]; i++)
        add(to, counts[i].key, whole(counts[i].count));
    if (r->surface_vertices == 0)
        return;
    add(to, "extent", vector(r->extent));
    add(to, "minimum", vector(r->minimum));
    add(to, "maximum", vector(r->maximum));
    add(to, "volume", json_object_new_double(r->volume));
    add(to, "edge_min", json_object_new_double(r->edge_min));
    add(to, "edge_mean", json_object_new_double(r->edge_mean));
    add(to, "edge_max", json_object_new_double(r->edge_max));
    add(to, "dihedral_min_deg", json_object_new_double(r->dihedral_min_deg));
    add(to, "dihedral_max_deg", json_object_new_double(r->dihedral_max_deg));
    struct json_object *histogram = json_object_new_array();
    for (int i = 0; i < 18; i++)
        json_object_array_add(histogram, whole(r->dihedral_histogram[i]));
    add(to, "dihedral_histogram", histogram);
}

/* A file may name its labels in any bytes; JSON is UTF-8. */
static struct json_object *text(const char *bytes)
{
    char clean[400];
    size_t n = 0;
    for (; *bytes && n < sizeof clean - 1; bytes++)
        clean[n++] = (unsigned char)*bytes < 128 ? *bytes : '?';
    clean[n] = 0;
    return json_object_new_string(clean);
}

static void print_json(const struct mesh *mesh, const struct mesh_report *r, const char *unit, int verdict,
                       const struct failure *why)
{
    char warning[8][500];
    size_t count = warnings(mesh, r, warning);
    struct json_object *root = json_object_new_object(), *labels = json_object_new_array(),
                       *list = json_object_new_array();
    add(root, "file", text(mesh->path));
    add(root, "unit", *unit ? json_object_new_string(unit) : NULL);
    add_measures(root, r);
    add(root, "ignored_elements", whole(mesh->ignored_elements));
    for (size_t i = 0; i < mesh->label_count; i++) {
        struct json_object *label = json_object_new_object();
        add(label, "number", json_object_new_int(mesh->label[i].number));
        add(label, "name", text(mesh->label[i].name));
        json_object_array_add(labels, label);
    }
    add(root, "labels", labels);
    for (size_t i = 0; i < count; i++)
        json_object_array_add(list, text(warning[i]));
    add(root, "warnings", list);
    add(root, "verdict", json_object_new_string(verdict ? "refused" : count ? "usable with warnings" : "usable"));
    if (verdict) {
        add(root, "status", json_object_new_string(status_name(verdict)));
        add(root, "cause", text(why->cause));
        add(root, "remedy", text(why->remedy));
    }
    puts(json_object_to_json_string_ext(root, JSON_C_TO_STRING_PRETTY | JSON_C_TO_STRING_NOSLASHESCAPE));
    json_object_put(root);
}

static void print_verdict(const struct mesh *mesh, const struct mesh_report *r, int verdict, const struct failure *why)
{
    char warning[8][500];
    size_t count = verdict ? 0 : warnings(mesh, r, warning);
    if (verdict) {
        printf("verdict: refused: %s\n", why->cause);
        return;
    }
    puts(count ? "verdict: usable with warnings:" : "verdict: usable");
    for (size_t i = 0; i < count; i++)
        printf("  %s\n", warning[i]);
}

/* Scaling before the check gives the report in metres; a mesh that cannot be scaled is refused by the check as well. */
static int judge(const struct options *o, struct mesh *mesh, struct failure *why)
{
    struct mesh_report report;
    struct failure scale_why, check_why;
    bool scaled = o->extent_m > 0 || o->unit != MESH_UNIT_NONE;
    int verdict = mesh_check(mesh, false, &report, &check_why);
    if (scaled &&
        (verdict == STATUS_OK || report.surface_vertices)) { /* what the check dropped has no say in the extent */
        if (mesh_scale(mesh, o->extent_m, o->unit, &scale_why) == STATUS_OK) {
            struct mesh_report again;
            struct failure ignored;
            mesh_check(mesh, false, &again, &ignored);
            for (int k = 0; k < 3; k++) {
                report.extent[k] = again.extent[k];
                report.minimum[k] = again.minimum[k];
                report.maximum[k] = again.maximum[k];
            }
            report.volume = again.volume;
            report.edge_min = again.edge_min;
            report.edge_mean = again.edge_mean;
            report.edge_max = again.edge_max;
        } else if (verdict == STATUS_OK) {
            verdict = scale_why.status;
            check_why = scale_why;
        }
    }
    const char *unit = scaled ? "m" : "";
    if (o->json) {
        print_json(mesh, &report, unit, verdict, &check_why);
    } else {
        print_text(mesh, &report, unit);
        print_verdict(mesh, &report, verdict, &check_why);
    }
    if (verdict) {
        *why = check_why;
        return verdict;
    }
    return o->output ? mesh_write_msh(mesh, o->output, why) : STATUS_OK;
}

int verb_mesh(int argc, char **argv, struct failure *why)
{
    struct options options = {0};
    int status = parse(argc, argv, &options, why);
    if (status)
        return status;
    if (options.help) {
        fputs(usage, stdout);
        return STATUS_OK;
    }
    static const char *const marks[] = {"$MeshFormat", "$NOD", NULL};
    struct mesh mesh;
    if (options.output)
        status = output_is_not_input(options.output, options.path, why);
    if (options.output && !status)
        status = output_may_replace(options.output, marks, "a Gmsh mesh", why);
    if (status)
        return status;
    status = mesh_read(options.path, options.size, &mesh, why);
    if (status)
        return status;
    status = judge(&options, &mesh, why);
    mesh_free(&mesh);
    return status;
}
