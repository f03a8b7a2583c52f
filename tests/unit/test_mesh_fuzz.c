/* Damaged files: cut at every length, and mutated at random. Readers must fail with one line or give a mesh that the check
 * can judge; under SAN=1 each buffer ends where its bytes end. */
#include "mesh_encode.h"
#include "mesh_readers.h"
#include "triangle_soup.h"

typedef int volume_reader(struct scan *, struct mesh *);
typedef int surface_reader(struct scan *, struct soup *);
typedef int mixed_reader(struct scan *, struct mesh *, struct soup *, bool *);

static struct sample {
    const char *name;
    struct bytes bytes;
    size_t complete; /* cut behind here, the file may pass: only blanks or labels are lost */
    volume_reader *volume;
    surface_reader *surface;
    mixed_reader *mixed;
} samples[32];
static size_t sample_count;

static struct sample *sample(const char *name)
{
    samples[sample_count].name = name;
    return &samples[sample_count++];
}

static size_t at(const struct bytes *b, const char *mark)
{
    const unsigned char *found = memmem(b->data, b->length, mark, strlen(mark));
    assert_non_null(found);
    return (size_t)(found - b->data);
}

static int make_samples(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(2);
    struct surface surface;
    struct mesh_report report;
    struct failure why;
    struct sample *s;
    assert_int_equal(mesh_check(&mesh, false, &report, &why), 0);
    assert_int_equal(mesh_surface(&mesh, &surface, &why), 0);
    encode_gmsh1(&mesh, &(s = sample("gmsh 1"))->bytes);
    s->volume = read_gmsh;
    for (int form = 0; form < 4; form++) {
        s = sample("gmsh 2 and 4");
        s->volume = read_gmsh;
        form & 1 ? encode_gmsh4(&mesh, form & 2, form & 2, &s->bytes) : encode_gmsh2(&mesh, form & 2, false, &s->bytes);
    }
    encode_vega(&mesh, 1, &(s = sample("vega"))->bytes);
    s->volume = read_vega;
    s->complete = at(&s->bytes, "*MATERIAL");
    for (int form = 0; form < 4; form++) {
        encode_vtk(&mesh, form & 1, form & 2 ? 5 : 2, &(s = sample("vtk"))->bytes);
        s->mixed = read_vtk;
        s->complete = at(&s->bytes, "CELL_DATA") - 4; /* the last "10" may become a 1, a point */
    }
    for (int form = 0; form < 8; form++) {
        encode_vtu(&mesh, (enum xml_form)(form & 3), form & 1, form & 2, form & 4, &(s = sample("vtu"))->bytes);
        s->mixed = read_vtk_xml;
        if (form & 2)
            s->complete = at(&s->bytes, "\n</AppendedData>");
    }
    encode_vtp(&mesh, &surface, XML_APPENDED_RAW, true, &(s = sample("vtp"))->bytes);
    s->mixed = read_vtk_xml;
    s->complete = at(&s->bytes, "\n</AppendedData>");
    for (int form = 0; form < 2; form++) {
        encode_stl(&mesh, &surface, form, &(s = sample("stl"))->bytes);
        s->surface = read_stl;
        if (form == 0)
            s->complete = at(&s->bytes, "endsolid") + 8;
    }
    encode_obj(&mesh, &surface, &(s = sample("obj"))->bytes);
    s->surface = read_obj;
    for (int form = 0; form < 3; form++) {
        encode_ply(&mesh, &surface, form, &(s = sample("ply"))->bytes);
        s->surface = read_ply;
    }
    for (size_t i = 0; i < sample_count; i++)
        if (samples[i].complete == 0)
            samples[i].complete = samples[i].bytes.length - 1;
    surface_free(&surface);
    mesh_free(&mesh);
    return 0;
}

static int free_samples(void **state)
{
    (void)state;
    for (size_t i = 0; i < sample_count; i++)
        free(samples[i].bytes.data);
    return 0;
}

/* Read, then do with the result what the program does with it. */
static int digest(const struct sample *how, const unsigned char *data, size_t length)
{
    struct mesh mesh = {.path = "fuzz"};
    struct soup soup = {0};
    struct failure why = {0};
    bool surface = how->surface != NULL;
    unsigned char *exact = malloc(length + 1);
    assert_non_null(exact);
    memcpy(exact, data, length);
    exact[length] = 0;
    struct scan s = scan_start("fuzz", exact, length, &why);
    int status = how->volume    ? how->volume(&s, &mesh)
                 : how->surface ? how->surface(&s, &soup)
                                : how->mixed(&s, &mesh, &soup, &surface);
    if (status == 0 && surface) {
        status = soup_close(&soup, "fuzz", &why);
    } else if (status == 0) {
        struct mesh_report report;
        struct surface skin;
        assert_true(mesh.tetrahedron_count > 0 && mesh.label_count > 0);
        if (mesh_check(&mesh, false, &report, &why) == 0) {
            assert_int_equal(mesh_surface(&mesh, &skin, &why), 0);
            surface_free(&skin);
        }
    }
    if (status != 0) {
        assert_int_equal(status, why.status);
        assert_true(*why.place && *why.cause);
    }
    free(exact);
    soup_free(&soup);
    mesh_free(&mesh);
    return status;
}

static void a_file_cut_anywhere_is_refused(void **state)
{
    (void)state;
    for (size_t i = 0; i < sample_count; i++) {
        const struct sample *s = &samples[i];
        assert_int_equal(digest(s, s->bytes.data, s->bytes.length), 0);
        for (size_t length = 0; length < s->bytes.length; length += 1 + length / 200)
            if (digest(s, s->bytes.data, length) == 0 && length < s->complete)
                fail_msg("%s: cut at %zu of %zu it passes", s->name, length, s->bytes.length);
    }
}

static uint64_t random_state;

static uint32_t draw(uint32_t below) /* splitmix64 */
{
    uint64_t z = random_state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return (uint32_t)((z ^ z >> 31) >> 32) % below;
}

static void mutate(struct bytes *b)
{
    static const char *const words[] = {"-1",  "0",     "4294967295", "99999999999999999999",
                                        "nan", "-inf",  "1e308",      "\n",
                                        "\0",  "$",     "*",          "<",
                                        "\"",  "10",    "4",          " ",
                                        "#",   "1e-320"};
    for (uint32_t n = 1 + draw(4); n > 0 && b->length > 8; n--) {
        size_t place = draw((uint32_t)b->length), length = draw(8), other = draw((uint32_t)b->length);
        length = length < b->length - place ? length : b->length - place;
        length = length < b->length - other ? length : b->length - other;
        const char *word = words[draw(sizeof words / sizeof words[0])];
        switch (draw(6)) {
        case 0: /* a bit */
            b->data[place] ^= (unsigned char)(1u << draw(8));
            break;
        case 1: /* a byte */
            b->data[place] = (unsigned char)draw(256);
            break;
        case 2: /* some bytes elsewhere */
            memmove(b->data + place, b->data + other, length);
            break;
        case 3: /* some bytes lost */
            memmove(b->data + place, b->data + place + length, b->length - place - length);
            b->length -= length;
            break;
        case 4: /* a word written over */
            for (size_t k = 0; word[k] && place + k < b->length; k++)
                b->data[place + k] = (unsigned char)word[k];
            break;
        default: /* a stretch of the highest bits */
            memset(b->data + place, 0xff, length);
        }
    }
}

static void mutated_files_are_refused_or_judged(void **state)
{
    (void)state;
    const char *seed = getenv("TROCAR_SEED");
    uint64_t start = seed ? strtoull(seed, NULL, 0) : 20240601;
    int rounds = getenv("TROCAR_LONG") ? 40000 : 1500;
    size_t passed = 0;
    print_message("# seed %llu, %d mutations of each of %zu files\n", (unsigned long long)start, rounds, sample_count);
    for (size_t i = 0; i < sample_count; i++) {
        random_state = start + 1000003 * i;
        for (int k = 0; k < rounds; k++) {
            struct bytes b = {0};
            put(&b, samples[i].bytes.data, samples[i].bytes.length);
            mutate(&b);
            passed += digest(&samples[i], b.data, b.length) == 0;
            free(b.data);
        }
    }
    print_message("# %zu still passed as meshes\n", passed);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_file_cut_anywhere_is_refused),
        cmocka_unit_test(mutated_files_are_refused_or_judged),
    };
    return cmocka_run_group_tests(tests, make_samples, free_samples);
}
