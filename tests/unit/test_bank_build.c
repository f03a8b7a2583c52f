/* From a mesh file to a bank and back: the whole of bank_build, bank_load, body_open and bank_verify on a small body with
 * single fixed components and a ligament. What is planted is found; what cannot be told is said. */
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <cmocka.h>

#include "bank.h"
#include "force_error.h"
#include "mesh_fixture.h"
#include "random.h"
#include "verify.h"

static char folder[512], mesh_path[600], bank_path[600], scene_path[600];
static struct failure why;

static const char scene_text[] =
    "scene: box\n"
    "body:\n"
    "  mesh: {file: box.msh, extent: 0.1 m}\n"
    "  materials:\n"
    "    - {label: all, E: %s, nu: 0.45, rho: 1060 kg/m3}\n"
    "    - {label: right, E: 9 kPa, nu: 0.3, rho: 1060 kg/m3}\n"
    "  fixed:\n"
    "    - {plane: {at: [0, 0, 0.001], normal: [0, 0, -1]}}\n"
    "    - {box: {from: [-0.001, -0.001, 0.05], to: [0.001, 0.11, 0.11]}, components: [x]}\n"
    "  ligaments:\n"
    "    - {box: {from: [0.09, 0, 0.05], to: [0.11, 0.1, 0.11]}, stiffness: 20 N/m, direction: [1, 0, 0]}\n"
    "instruments:\n"
    "  - {name: right}\n%s";

static void write_text(const char *path, const char *text)
{
    assert_int_equal(file_replace(path, text, strlen(text), &why), STATUS_OK);
}

static void write_scene(const char *young, const char *more)
{
    char text[2048];
    snprintf(text, sizeof text, scene_text, young, more);
    write_text(scene_path, text);
}

static void write_mesh(int n)
{
    struct mesh mesh = box_mesh(n);
    assert_int_equal(mesh_write_msh(&mesh, mesh_path, &why), STATUS_OK);
    mesh_free(&mesh);
}

static int build(struct build_result *result)
{
    struct scene *scene = malloc(sizeof *scene);
    int status = scene_read(scene_path, scene, &why);
    if (!status)
        status = bank_build(scene, bank_path, &(struct compression){.plain = true}, INFINITY, true, result, &why);
    free(scene);
    return status;
}

static int setup(void **state)
{
    (void)state;
    struct build_result result;
    snprintf(folder, sizeof folder, "%s", temporary_path("bank-XXXXXX"));
    assert_non_null(mkdtemp(folder));
    snprintf(mesh_path, sizeof mesh_path, "%s/box.msh", folder);
    snprintf(bank_path, sizeof bank_path, "%s/box.bank", folder);
    snprintf(scene_path, sizeof scene_path, "%s/box.yaml", folder);
    write_mesh(5);
    write_scene("4 kPa", "");
    int status = build(&result);
    if (status)
        failure_print(stderr, &why);
    return status;
}

static int teardown(void **state)
{
    (void)state;
    unlink(mesh_path);
    unlink(bank_path);
    unlink(scene_path);
    return rmdir(folder); /* fails when anything else was left behind */
}

static void built_bank_agrees_with_its_scene(void **state)
{
    (void)state;
    struct bank_file bank;
    struct body body;
    struct verify_result found;
    assert_int_equal(bank_load(bank_path, &bank, &why), STATUS_OK);
    assert_int_equal(body_open(&bank, NULL, &body, &why), STATUS_OK);
    assert_int_equal(bank_verify(&bank.view, &body, BANK_MAX_VERTICES, 1, true, &found, &why), STATUS_OK);
    assert_string_equal(found.differs, "");
    assert_int_equal(found.columns, bank.view.row_count);
    assert_int_equal(found.entries, 9 * (size_t)bank.view.row_count * bank.view.row_count);
    assert_true(found.worst <= 1);
    body_close(&body);
    bank_unload(&bank);
}

static void built_bank_agrees_with_the_scene_file(void **state)
{
    (void)state;
    struct bank_file bank;
    struct body body;
    struct verify_result found;
    assert_int_equal(bank_load(bank_path, &bank, &why), STATUS_OK);
    assert_int_equal(body_open(&bank, scene_path, &body, &why), STATUS_OK);
    assert_int_equal(bank_verify(&bank.view, &body, 4, 1, true, &found, &why), STATUS_OK);
    assert_string_equal(found.differs, "");
    body_close(&body);
    write_scene("4.001 kPa", ""); /* another tissue: every column */
    assert_int_equal(body_open(&bank, scene_path, &body, &why), STATUS_CHECK_FAILED);
    assert_non_null(strstr(why.cause, "here \"- {label: all, E: 4001 Pa"));
    struct scene scene;
    assert_int_equal(scene_read(scene_path, &scene, &why), STATUS_OK);
    assert_int_equal(body_from_scene(&scene, &body, NULL, &why), STATUS_OK);
    assert_int_equal(bank_verify(&bank.view, &body, 1, 1, true, &found, &why), STATUS_OK);
    assert_non_null(strstr(found.differs, "in a direct solve"));
    body_close(&body);
    write_scene("4 kPa", "");
    bank_unload(&bank);
}

/* One entry of one column off by a millionth of itself: seven float32 roundings. */
static void planted_wrong_column_is_found(void **state)
{
    (void)state;
    random_seed("plant", 1);
    struct bank_file bank;
    struct body body;
    struct verify_result found;
    assert_int_equal(bank_load(bank_path, &bank, &why), STATUS_OK);
    assert_int_equal(body_open(&bank, NULL, &body, &why), STATUS_OK);
    for (int round = 0; round < 5; round++) {
        float *half = (float *)(uintptr_t)bank.view.half, *entry;
        do
            entry = half + random_below(9 * bank.view.row_count * (bank.view.row_count + 1) / 2);
        while (fabsf(*entry) < 1e-3f * bank.view.contact->typical_compliance_m_N);
        float keep = *entry;
        *entry *= 1.000001f;
        assert_int_equal(bank_verify(&bank.view, &body, BANK_MAX_VERTICES, 1, true, &found, &why), STATUS_OK);
        assert_true(found.wrong == 1 || found.wrong == 2); /* once per column that holds it */
        assert_non_null(strstr(found.differs, "in a direct solve"));
        *entry = keep;
    }
    body_close(&body);
    bank_unload(&bank);
}

static void planted(struct bank_file *bank, struct body *body, void *at, size_t size, uint32_t mask, const char *what)
{
    uint32_t keep = 0, changed;
    struct verify_result found;
    memcpy(&keep, at, size);
    changed = keep ^ mask;
    memcpy(at, &changed, size);
    assert_int_equal(bank_verify(&bank->view, body, 1, 1, true, &found, &why), STATUS_OK);
    if (!strstr(found.differs, what))
        fail_msg("\"%s\" instead of \"%s\"", found.differs, what);
    memcpy(at, &keep, size);
}

static void planted_differences_elsewhere_are_found(void **state)
{
    (void)state;
    struct bank_file bank;
    struct body body;
    assert_int_equal(bank_load(bank_path, &bank, &why), STATUS_OK);
    assert_int_equal(body_open(&bank, NULL, &body, &why), STATUS_OK);
    const struct bank_view *v = &bank.view;
    planted(&bank, &body, (void *)(uintptr_t)&v->contact->force_limit_N, 4, 1, "contact record");
    planted(&bank, &body, (void *)(uintptr_t)&v->contact->regularisation_m_N, 4, 1 << 10, "regularisation");
    planted(&bank, &body, (void *)(uintptr_t)&v->contact->typical_compliance_m_N, 4, 1 << 20, "typical compliance");
    planted(&bank, &body, (void *)(uintptr_t)&v->tools[0].trocar_m[1], 4, 1 << 16, "record of instrument 0");
    planted(&bank, &body, (void *)(uintptr_t)&v->normals[4], 4, 1 << 12, "normal of vertex 1");
    planted(&bank, &body, (void *)(uintptr_t)&v->triangles[3].neighbour[1], 2, 1, "neighbour");
    planted(&bank, &body, (void *)(uintptr_t)&v->cell_triangle[v->grid->entries / 2], 2, 0xFFFF, "grid");
    body_close(&body);
    bank_unload(&bank);
}

static void the_mesh_is_found_from_another_folder(void **state)
{
    (void)state;
    struct bank_file bank;
    struct body body;
    char moved[600];
    assert_int_equal(bank_load(bank_path, &bank, &why), STATUS_OK);
    snprintf(bank.mesh_path, sizeof bank.mesh_path, "elsewhere/box.msh"); /* beside the bank by its name */
    assert_int_equal(body_open(&bank, NULL, &body, &why), STATUS_OK);
    body_close(&body);
    snprintf(bank.mesh_path, sizeof bank.mesh_path, "elsewhere/other.msh"); /* by its way from the bank */
    assert_string_equal(bank.provenance.mesh_from_bank, "box.msh");
    assert_int_equal(body_open(&bank, NULL, &body, &why), STATUS_OK);
    body_close(&body);
    snprintf(moved, sizeof moved, "%s/moved.msh", folder);
    assert_int_equal(rename(mesh_path, moved), 0);
    assert_int_equal(body_open(&bank, NULL, &body, &why), STATUS_FILE_OPEN);
    assert_non_null(strstr(why.cause, "not found"));
    assert_int_equal(rename(moved, mesh_path), 0);
    bank_unload(&bank);
}

static void a_changed_mesh_is_refused(void **state)
{
    (void)state;
    struct bank_file bank;
    struct body body;
    assert_int_equal(bank_load(bank_path, &bank, &why), STATUS_OK);
    write_mesh(4);
    assert_int_equal(body_open(&bank, NULL, &body, &why), STATUS_CHECK_FAILED);
    assert_non_null(strstr(why.cause, "the mesh has changed"));
    assert_int_equal(body_open(&bank, scene_path, &body, &why), STATUS_CHECK_FAILED);
    write_mesh(5);
    assert_int_equal(body_open(&bank, NULL, &body, &why), STATUS_OK);
    body_close(&body);
    bank_unload(&bank);
}

/* Rounding of G by 2^-24 against condition numbers below 2e4 (epsilon): at most 1e-3; well-spread patches have less. */
static void force_error_of_a_plain_bank_is_that_of_rounding(void **state)
{
    (void)state;
    struct bank_file bank;
    struct body body;
    struct force_error error, worse;
    assert_int_equal(bank_load(bank_path, &bank, &why), STATUS_OK);
    assert_int_equal(body_open(&bank, NULL, &body, &why), STATUS_OK);
    assert_int_equal(force_error_measure(&bank.view, &body, 40, 7, NULL, &error, &why), STATUS_OK);
    assert_int_equal(error.trials, 40);
    assert_true(error.max > 0 && error.max < 2e4 * 0x1p-24);
    assert_true(error.p95 <= error.max);
    assert_true(bank.provenance.force_error_max > 0 && bank.provenance.force_error_max < 2e4 * 0x1p-24);
    float *half = (float *)(uintptr_t)bank.view.half; /* a bank that is one per cent too soft */
    for (size_t k = 0; k < 9 * (size_t)bank.view.row_count * (bank.view.row_count + 1) / 2; k++)
        half[k] *= 1.01f;
    assert_int_equal(force_error_measure(&bank.view, &body, 40, 7, NULL, &worse, &why), STATUS_OK);
    assert_true(worse.max > 0.008 && worse.max < 0.012);
    body_close(&body);
    bank_unload(&bank);
}

static void budgets_of_the_scene_hold(void **state)
{
    (void)state;
    struct build_result result;
    struct stat before, after;
    assert_int_equal(stat(bank_path, &before), 0);
    write_scene("4 kPa", "budget: {bank: 10 KiB}\n");
    assert_int_equal(build(&result), STATUS_BANK_LIMIT);
    assert_non_null(strstr(why.cause, "bytes"));
    write_scene("4 kPa", "budget: {force_error: 0.0000001 %}\n");
    assert_int_equal(build(&result), STATUS_BANK_LIMIT);
    assert_non_null(strstr(why.cause, "force error"));
    assert_int_equal(stat(bank_path, &after), 0); /* the old bank is untouched */
    assert_true(before.st_ino == after.st_ino);
    write_scene("4 kPa", "");
}

/* In a process of its own, since the flag that Ctrl-C raises stays up. */
static void an_interrupted_build_leaves_the_old_bank(void **state)
{
    (void)state;
    struct stat before, after;
    assert_int_equal(stat(bank_path, &before), 0);
    pid_t child = fork();
    if (child == 0) {
        struct build_result result;
        interrupt_install();
        raise(SIGINT);
        _exit(build(&result) == STATUS_INTERRUPTED ? 0 : 1);
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    assert_int_equal(stat(bank_path, &after), 0);
    assert_true(before.st_ino == after.st_ino);
}

static void a_damaged_bank_says_where(void **state)
{
    (void)state;
    unsigned char *bytes;
    size_t length;
    struct bank_file bank;
    char other[600];
    snprintf(other, sizeof other, "%s/damaged.bank", folder);
    assert_int_equal(file_load(bank_path, &bytes, &length, &why), STATUS_OK);
    bytes[length / 2] ^= 4;
    assert_int_equal(file_replace(other, bytes, length, &why), STATUS_OK);
    assert_int_equal(bank_load(other, &bank, &why), STATUS_BANK_CRC);
    assert_non_null(strstr(why.cause, "GHLF"));
    bytes[length / 2] ^= 4;
    assert_int_equal(file_replace(other, bytes, length - 16, &why), STATUS_OK);
    assert_int_equal(bank_load(other, &bank, &why), STATUS_BANK_LENGTH);
    bytes[4] = 2;
    assert_int_equal(file_replace(other, bytes, length, &why), STATUS_OK);
    assert_int_equal(bank_load(other, &bank, &why), STATUS_BANK_VERSION);
    assert_string_equal(why.remedy, "upgrade this program");
    assert_int_equal(bank_load(mesh_path, &bank, &why), STATUS_BANK_MAGIC);
    assert_int_equal(bank_load("/no/such/bank", &bank, &why), STATUS_FILE_OPEN);
    unlink(other);
    free(bytes);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(built_bank_agrees_with_its_scene),
        cmocka_unit_test(built_bank_agrees_with_the_scene_file),
        cmocka_unit_test(planted_wrong_column_is_found),
        cmocka_unit_test(planted_differences_elsewhere_are_found),
        cmocka_unit_test(the_mesh_is_found_from_another_folder),
        cmocka_unit_test(a_changed_mesh_is_refused),
        cmocka_unit_test(force_error_of_a_plain_bank_is_that_of_rounding),
        cmocka_unit_test(budgets_of_the_scene_hold),
        cmocka_unit_test(an_interrupted_build_leaves_the_old_bank),
        cmocka_unit_test(a_damaged_bank_says_where),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
