/* Seeded mutations of good scenes: whatever a file holds, reading ends in a scene or in a named refusal with a line that
 * exists, and a scene that is read can be printed and read again. Under the sanitizers this is also a search for bad
 * accesses. TROCAR_LONG=1 makes a hundred times as many. */
#include "../unit/scene_fixture.h"

#include "random.h"

static const char *const pieces[] = {
    "{",         "}",       "[",
    "]",         ",",       ":",
    ": ",        "\n",      "  ",
    "- ",        "#",       "\"",
    "'",         "&a ",     "*a",
    "!t ",       "|\n",     ">\n",
    "? ",        "---\n",   "...\n",
    "%YAML 9\n", "\t",      "0",
    "-1",        "1e308",   "1e-320",
    ".nan",      "..",      " %",
    " mm",       " kPa",    " N s/m",
    "null",      "~",       "\xC3\xA9",
    "\xFF",      "\x01",    "\xEF\xBB\xBF",
    "scene:",    "body:",   "box:",
    "share:",    "all",     "points: ",
    "<<: ",      "nu: 0.5", "99999999999999999999999999999999999999",
};

/* At least as many as YAML's own count: CR, NEL (C2 85), LS and PS (E2 80 A8, A9) break lines too. */
static size_t lines_of(const char *text, size_t length)
{
    size_t lines = 1;
    for (size_t i = 0; i < length; i++)
        lines += strchr("\n\r\x85\xA8\xA9", text[i]) != NULL;
    return lines;
}

static size_t mutate(unsigned char *text, size_t length, size_t room)
{
    size_t at = length ? random_below((unsigned)length) : 0;
    size_t rest = length - at, cut = random_below(20) + 1;
    if (cut > rest)
        cut = rest;
    const char *piece = pieces[random_below(sizeof pieces / sizeof pieces[0])];
    size_t size = strlen(piece);
    switch (random_below(6)) {
    case 0: /* another byte */
        if (rest)
            text[at] = (unsigned char)random_below(256);
        return length;
    case 1: /* cut out */
        memmove(text + at, text + at + cut, rest - cut);
        return length - cut;
    case 2: /* cut short */
        return random_below(8) ? length : at;
    case 3: /* a piece in place of as many bytes */
        if (size > rest)
            size = rest;
        memcpy(text + at, piece, size);
        return length;
    case 4: /* repeat a part */
        if (length + cut > room)
            return length;
        memmove(text + at + cut, text + at, rest);
        return length + cut;
    default: /* a piece between */
        if (length + size > room)
            return length;
        memmove(text + at + size, text + at, rest);
        memcpy(text + at, piece, size);
        return length + size;
    }
}

static void judge(const char *text, size_t length, unsigned *accepted)
{
    struct scene scene;
    struct failure why = {0};
    int status = scene_parse(text, length, "s.yaml", &scene, &why);
    if (status) {
        assert_in_range(-status, -STATUS_SCENE_SYNTAX, -STATUS_SCENE_MISSING);
        assert_int_equal(why.status, status);
        assert_true(why.cause[0] && why.remedy[0]);
        const char *colon = strchr(why.place, ':');
        assert_true(!colon || (size_t)strtol(colon + 1, NULL, 10) <= lines_of(text, length) + 1);
        return;
    }
    ++*accepted;
    char *printed = scene_print(&scene);
    struct scene back;
    if (parse(printed, "", &back, &why))
        fail_msg("%s: %s\n%s", why.place, why.cause, printed);
    same_scene(&scene, &back);
    free(printed);
}

static void mutated_scenes_are_read_or_refused_by_name(void **state)
{
    (void)state;
    enum { ROOM = 4096 };
    random_seed("mutations", 24);
    unsigned runs = getenv("TROCAR_LONG") ? 2000000 : 20000, accepted = 0;
    for (unsigned k = 0; k < runs; k++) {
        const char *start = k % 4 ? scene_full : scene_small;
        unsigned char work[ROOM];
        size_t length = strlen(start);
        memcpy(work, start, length);
        for (unsigned changes = 1 + random_below(4); changes > 0; changes--)
            length = mutate(work, length, sizeof work);
        char *exact = malloc(length + 1); /* so that a read behind the end is seen */
        assert_non_null(exact);
        memcpy(exact, work, length);
        exact = realloc(exact, length ? length : 1);
        judge(exact, length, &accepted);
        free(exact);
    }
    print_message("# %u of %u mutations are still scenes\n", accepted, runs);
    assert_true(accepted > runs / 50 && accepted < runs / 2); /* both outcomes are exercised */
}

static void a_scene_cut_at_any_byte_is_read_or_refused(void **state)
{
    (void)state;
    unsigned accepted = 0;
    for (size_t length = 0; length <= strlen(scene_full); length++) {
        char *exact = malloc(length ? length : 1);
        assert_non_null(exact);
        memcpy(exact, scene_full, length);
        judge(exact, length, &accepted);
        free(exact);
    }
    assert_true(accepted > 0);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(mutated_scenes_are_read_or_refused_by_name),
        cmocka_unit_test(a_scene_cut_at_any_byte_is_read_or_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
