#include "mesh_fill.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "mesh_readers.h"
#include "progress.h"

struct child {
    const char *path, *remedy; /* of the mesh, for errors */
    char program[4096];
    double limit_s;
    int input, output, errors[2]; /* memory files and a pipe; -1 if not open */
    pid_t process;
    char text[4096]; /* the end of what it wrote to standard error */
    size_t text_length;
};

static int find_mesher(struct child *c, struct failure *why)
{
    const char *given = getenv("TROCAR_MESHER"), *limit = getenv("TROCAR_MESHER_SECONDS");
    c->limit_s = limit && strtod(limit, NULL) > 0 ? strtod(limit, NULL) : 900;
    if (given && *given) {
        snprintf(c->program, sizeof c->program, "%s", given);
    } else {
        ssize_t n = readlink("/proc/self/exe", c->program, sizeof c->program - 1);
        c->program[n > 0 ? n : 0] = 0;
        char *slash = strrchr(c->program, '/');
        size_t stem = slash ? (size_t)(slash + 1 - c->program) : 0;
        snprintf(c->program + stem, sizeof c->program - stem, "trocar-mesher");
    }
    if (access(c->program, X_OK) == 0)
        return STATUS_OK;
    return failure_set(why, STATUS_TOOL_MISSING, c->path, "build it, or name it in TROCAR_MESHER",
                       "the program that fills surfaces is not there: %.200s", c->program);
}

static int write_all(int file, const void *bytes, size_t length)
{
    const char *p = bytes;
    while (length > 0) {
        ssize_t n = write(file, p, length > (1u << 24) ? (1u << 24) : length);
        if (n < 0 && errno == EINTR && !interrupted())
            continue;
        if (n <= 0)
            return -1;
        p += n;
        length -= (size_t)n;
    }
    return 0;
}

static int write_soup(int file, const struct soup *soup)
{
    struct fill_head head = {FILL_MAGIC, (uint32_t)soup->shell_count, soup->vertex_count, soup->triangle_count};
    return write_all(file, &head, sizeof head) ||
           write_all(file, soup->vertices, soup->vertex_count * 3 * sizeof *soup->vertices) ||
           write_all(file, soup->triangles, soup->triangle_count * 3 * sizeof *soup->triangles) ||
           write_all(file, soup->shell, soup->triangle_count * sizeof *soup->shell) ||
           write_all(file, soup->inside, soup->shell_count * sizeof *soup->inside) || lseek(file, 0, SEEK_SET) != 0;
}

static int start(struct child *c, const char *const arguments[], struct failure *why)
{
    pid_t parent = getpid();
    if (pipe2(c->errors, O_CLOEXEC) == 0)
        c->process = fork();
    if (c->process < 0)
        return failure_set(why, STATUS_MESH_SURFACE, c->path, "try again", "the mesher cannot be started: %s",
                           strerror(errno));
    if (c->process > 0) {
        close(c->errors[1]);
        c->errors[1] = -1;
        return STATUS_OK;
    }
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    signal(SIGINT, SIG_IGN); /* the parent, who gets the same Ctrl-C, ends this process */
    if (getppid() == parent && dup2(c->input, 0) >= 0 && dup2(c->output, 1) >= 0 && dup2(c->errors[1], 2) >= 0)
        execv(c->program, (char *const *)arguments);
    _exit(127);
}

/* Keep the last bytes of standard error. */
static bool listen_to(struct child *c)
{
    size_t half = sizeof c->text / 2;
    if (c->text_length > half) {
        memmove(c->text, c->text + c->text_length - half, half);
        c->text_length = half;
    }
    ssize_t n = read(c->errors[0], c->text + c->text_length, half - 1);
    if (n > 0)
        c->text_length += (size_t)n;
    return n > 0 || (n < 0 && errno == EINTR);
}

/* Wait for the end, the limit or an interrupt; in the last two cases end it. */
static int wait_for(struct child *c, int *ended, struct failure *why)
{
    double until_s = seconds_now() + c->limit_s;
    bool open = true, running = true;
    int status = STATUS_OK;
    while (running) {
        struct pollfd ready = {.fd = open ? c->errors[0] : -1, .events = POLLIN};
        poll(&ready, 1, open ? 50 : 2); /* an interrupt is seen within 50 ms */
        if (ready.revents)
            open = listen_to(c);
        pid_t done = waitpid(c->process, ended, WNOHANG);
        running = done == 0 || (done < 0 && errno == EINTR);
        if (!running || status)
            continue;
        if (interrupted())
            status = failure_set(why, STATUS_INTERRUPTED, c->path, NULL, "interrupted while filling the surface");
        else if (seconds_now() > until_s)
            status = failure_set(why, STATUS_MESH_SURFACE, c->path,
                                 "choose a larger --size, or more time in TROCAR_MESHER_SECONDS",
                                 "filling the surface took longer than %g s", c->limit_s);
        if (status)
            kill(c->process, SIGKILL);
    }
    c->process = 0;
    struct pollfd ready = {.fd = c->errors[0], .events = POLLIN};
    while (open && poll(&ready, 1, 0) > 0)
        open = listen_to(c);
    return status;
}

/* The last line that the mesher gave as its reason, else the last line at all. */
static const char *reason(struct child *c)
{
    static const char mark[] = "trocar-mesher: ";
    char *last = NULL, *any = NULL;
    c->text[c->text_length] = 0;
    for (char *line = strtok(c->text, "\n"); line; line = strtok(NULL, "\n")) {
        any = line;
        if (strncmp(line, mark, sizeof mark - 1) == 0)
            last = line + sizeof mark - 1;
    }
    return last ? last : any ? any : "it gave no reason";
}

static int read_output(struct child *c, struct mesh *mesh, struct failure *why)
{
    off_t length = lseek(c->output, 0, SEEK_END);
    unsigned char *bytes = length >= 0 ? malloc((size_t)length + 1) : NULL;
    if (!bytes)
        return failure_set(why, STATUS_MEMORY, c->path, NULL, "no memory for the mesher's %lld bytes",
                           (long long)length);
    size_t got = 0;
    ssize_t n;
    while ((n = pread(c->output, bytes + got, (size_t)length - got, (off_t)got)) > 0)
        got += (size_t)n;
    bytes[got] = 0;
    struct scan s = scan_start(c->path, bytes, got, why);
    int status = read_gmsh(&s, mesh);
    if (status == STATUS_MESH_SYNTAX) {
        char cause[sizeof why->cause];
        snprintf(cause, sizeof cause, "%s", why->cause);
        failure_set(why, STATUS_MESH_SURFACE, c->path, NULL, "the mesher's output is not understood: %.300s", cause);
        status = STATUS_MESH_SURFACE;
    }
    free(bytes);
    return status;
}

static int run(struct child *c, const struct soup *soup, const char *const arguments[], struct mesh *mesh,
               struct failure *why)
{
    int ended = 0;
    c->input = memfd_create("surface", MFD_CLOEXEC);
    c->output = memfd_create("mesh", MFD_CLOEXEC);
    if (c->input < 0 || c->output < 0 || (soup && write_soup(c->input, soup) != 0))
        return failure_set(why, STATUS_MEMORY, c->path, NULL, "no memory file for the mesher: %s", strerror(errno));
    int status = start(c, arguments, why);
    if (status == STATUS_OK)
        status = wait_for(c, &ended, why);
    if (status)
        return status;
    if (WIFSIGNALED(ended))
        return failure_set(why, STATUS_MESH_SURFACE, c->path, NULL, "the mesher was ended by signal %d (%s)",
                           WTERMSIG(ended), strsignal(WTERMSIG(ended)));
    if (WEXITSTATUS(ended) == 127 && c->text_length == 0)
        return failure_set(why, STATUS_TOOL_MISSING, c->path, "build it, or name it in TROCAR_MESHER",
                           "the mesher cannot be run: %.200s", c->program);
    if (WEXITSTATUS(ended) != 0)
        return failure_set(why, STATUS_MESH_SURFACE, c->path, c->remedy, "%.350s", reason(c));
    return read_output(c, mesh, why);
}

static int fill(const struct soup *soup, const char *const arguments[], const char *path, const char *remedy,
                struct mesh *mesh, struct failure *why)
{
    struct child c = {.path = path, .remedy = remedy, .input = -1, .output = -1, .errors = {-1, -1}, .process = -1};
    int status = find_mesher(&c, why);
    if (status == STATUS_OK)
        status = run(&c, soup, arguments, mesh, why);
    int files[] = {c.input, c.output, c.errors[0], c.errors[1]};
    for (int i = 0; i < 4; i++)
        if (files[i] >= 0)
            close(files[i]);
    return status;
}

int mesh_fill(const struct soup *soup, double size, const char *path, struct mesh *mesh, struct failure *why)
{
    char text[32];
    snprintf(text, sizeof text, "%.17g", size);
    return fill(soup, (const char *[]){"trocar-mesher", "surface", text, NULL}, path,
                size > 0 ? "choose another --size, or repair the surface where it crosses itself"
                         : "give --size to remesh the surface, or repair it where it crosses itself",
                mesh, why);
}

int mesh_geometry(double size, const char *path, struct mesh *mesh, struct failure *why)
{
    char text[32], file[4096];
    snprintf(text, sizeof text, "%.17g", size);
    snprintf(file, sizeof file, "%s", path);
    return fill(NULL, (const char *[]){"trocar-mesher", "geometry", text, file, NULL}, path,
                "correct the geometry script", mesh, why);
}
