/* The doctor on machines made of files: what is there is found, what is not gets its command. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmocka.h>

#include "doctor.h"

static char root[] = "/tmp/trocar-doctor-XXXXXX";

static void put(const char *path, const char *text, mode_t mode)
{
    char whole[300];
    snprintf(whole, sizeof whole, "%s/%s", root, path);
    for (char *slash = strchr(whole + strlen(root) + 1, '/'); slash; slash = strchr(slash + 1, '/')) {
        *slash = 0;
        mkdir(whole, 0755);
        *slash = '/';
    }
    FILE *file = fopen(whole, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
    assert_int_equal(chmod(whole, mode), 0);
}

static const struct doctor_check *check(const struct doctor *doctor, const char *name)
{
    for (size_t i = 0; i < doctor->count; i++)
        if (!strcmp(doctor->check[i].name, name))
            return &doctor->check[i];
    fail_msg("there is no check %s", name);
    return NULL;
}

static struct doctor look(void)
{
    static char path[100], program[100];
    struct doctor doctor;
    snprintf(path, sizeof path, "/nowhere:%s/bin", root);
    snprintf(program, sizeof program, "%s/bin/trocar", root);
    doctor_look(&doctor, &(struct doctor_place){.root = root, .path = path, .program = program});
    return doctor;
}

static int start(void **state)
{
    (void)state;
    unsetenv("TROCAR_MESHER");
    return mkdtemp(root) ? 0 : -1;
}

static int end(void **state)
{
    char command[60];
    (void)state;
    snprintf(command, sizeof command, "rm -rf %s", root);
    return system(command);
}

/* Run first: the machine has nothing at all. */
static void an_empty_machine_gets_a_command_for_every_no(void **state)
{
    (void)state;
    struct doctor doctor = look();
    unsigned no = 0;
    for (size_t i = 0; i < doctor.count; i++) {
        const struct doctor_check *c = &doctor.check[i];
        assert_true(*c->found && *c->use && *c->group);
        no += c->answer == DOCTOR_NO;
        assert_true(c->answer == DOCTOR_YES ? !*c->fix : *c->fix != 0);
        for (size_t k = 0; k < i; k++)
            assert_string_not_equal(c->name, doctor.check[k].name);
    }
    assert_true(no >= 12);
    assert_true(doctor.count < DOCTOR_CHECKS);
    assert_int_equal(check(&doctor, "memory")->answer, DOCTOR_NO);
    assert_int_equal(check(&doctor, "trocar-mesher")->answer, DOCTOR_NO);
    assert_true(check(&doctor, "trocar-mesher")->needed);
    assert_string_equal(check(&doctor, "candump")->fix, "as root: apt-get install -y can-utils");
    assert_non_null(strstr(check(&doctor, "socketcan")->fix, "linux-image-amd64"));
    assert_non_null(strstr(check(&doctor, "interfaces")->fix, "first the kernel"));
}

static void interfaces_are_told_by_type_and_state(void **state)
{
    (void)state;
    put("proc/meminfo", "MemTotal: 999999 kB\nMemAvailable: 2048000 kB\n", 0644);
    put("proc/net/can/version", "", 0644);
    put("sys/class/net/eth0/type", "1\n", 0644);
    put("sys/class/net/eth0/flags", "0x1003\n", 0644);
    struct doctor doctor = look();
    assert_int_equal(check(&doctor, "socketcan")->answer, DOCTOR_YES);
    assert_int_equal(check(&doctor, "interfaces")->answer, DOCTOR_NO);
    assert_non_null(strstr(check(&doctor, "interfaces")->fix, "ip link add vcan0 type vcan"));
    assert_string_equal(check(&doctor, "memory")->found, "2000 MiB free");

    put("sys/class/net/can7/type", "280\n", 0644);
    put("sys/class/net/can7/flags", "0x40080\n", 0644);
    doctor = look();
    assert_int_equal(check(&doctor, "interfaces")->answer, DOCTOR_PARTLY);
    assert_string_equal(check(&doctor, "interfaces")->found, "down: can7");
    assert_string_equal(check(&doctor, "interfaces")->fix, "as root: ip link set can7 up type can bitrate 1000000");

    put("sys/class/net/vcan1/type", "280\n", 0644);
    put("sys/class/net/vcan1/flags", "0xc1\n", 0644);
    doctor = look();
    assert_int_equal(check(&doctor, "interfaces")->answer, DOCTOR_YES);
    assert_string_equal(check(&doctor, "interfaces")->found, "up: vcan1; down: can7");
}

static void programs_and_the_mesher_are_found_where_they_are(void **state)
{
    (void)state;
    put("bin/candump", "#!/bin/sh\n", 0755);
    put("bin/firefox", "not a program\n", 0644);
    put("bin/trocar-mesher", "#!/bin/sh\n", 0755);
    put("dev/ttyACM3", "", 0666);
    put("dev/ttyS0", "", 0666);
    struct doctor doctor = look();
    char wanted[100];
    snprintf(wanted, sizeof wanted, "%s/bin/candump", root);
    assert_string_equal(check(&doctor, "candump")->found, wanted);
    assert_int_equal(check(&doctor, "browser")->answer, DOCTOR_NO); /* it cannot be run */
    assert_int_equal(check(&doctor, "trocar-mesher")->answer, DOCTOR_YES);
    assert_string_equal(check(&doctor, "serial_adapters")->found, "/dev/ttyACM3");
    for (size_t i = 0; i < doctor.count; i++)
        assert_true(!doctor.check[i].needed || doctor.check[i].answer == DOCTOR_YES);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_empty_machine_gets_a_command_for_every_no),
        cmocka_unit_test(interfaces_are_told_by_type_and_state),
        cmocka_unit_test(programs_and_the_mesher_are_found_where_they_are),
    };
    return cmocka_run_group_tests_name("doctor", tests, start, end);
}
