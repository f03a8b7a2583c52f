/* dbcgen DBC DIRECTORY: write DIRECTORY/wire.h and DIRECTORY/wire.c from the protocol file. Exit codes as status.def
 * says. */
#include <stdio.h>
#include <stdlib.h>

#include "dbcgen.h"
#include "progress.h"

typedef int generator(FILE *out, const struct dbc *dbc, struct failure *why);

static int write_one(const char *directory, const char *file, generator *generate, const struct dbc *dbc,
                     struct failure *why)
{
    char path[4096];
    char *text = NULL;
    size_t length = 0;
    if ((size_t)snprintf(path, sizeof path, "%s/%s", directory, file) >= sizeof path)
        return failure_set(why, STATUS_FILE_OPEN, directory, "", "the path is too long");
    FILE *out = open_memstream(&text, &length);
    if (!out)
        return failure_set(why, STATUS_MEMORY, NULL, "", "no memory for the generated code");
    int status = generate(out, dbc, why);
    if (fclose(out) != 0 && status == STATUS_OK)
        status = failure_set(why, STATUS_MEMORY, NULL, "", "no memory for the generated code");
    if (status == STATUS_OK)
        status = file_replace(path, text, length, why);
    free(text);
    return status;
}

int main(int argc, char **argv)
{
    struct failure why = {0};
    struct dbc *dbc = NULL;
    if (argc != 3) {
        failure_set(&why, STATUS_USAGE, NULL, "give dbcgen DBC DIRECTORY", "%d arguments, not 2", argc - 1);
        failure_print(stderr, &why);
        return status_exit_code(STATUS_USAGE);
    }
    int status = dbc_read(argv[1], &dbc, &why);
    if (status == STATUS_OK)
        status = write_one(argv[2], "wire.h", dbcgen_header, dbc, &why);
    if (status == STATUS_OK)
        status = write_one(argv[2], "wire.c", dbcgen_source, dbc, &why);
    dbc_free(dbc);
    if (status != STATUS_OK)
        failure_print(stderr, &why);
    return status == STATUS_OK ? 0 : status_exit_code(status);
}
