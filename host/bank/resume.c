#include "resume.h"

#include <openssl/evp.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <zlib.h>

static const char MARK[8] = "TRCPART1";

struct head {
    char mark[8];
    unsigned char key[RESUME_KEY_BYTES];
    uint64_t rows, vertices;
    double median_m_N;
};

enum found { NOTHING, KEPT, STRANGER };

static enum found look(const struct resume *resume, struct head *head)
{
    FILE *file = fopen(resume->path, "rb");
    if (!file)
        return access(resume->path, F_OK) == 0 ? STRANGER : NOTHING;
    bool ours = fread(head, sizeof *head, 1, file) == 1 && !memcmp(head->mark, MARK, sizeof MARK);
    fclose(file);
    return ours ? KEPT : STRANGER;
}

int resume_begin(const char *bank_path, const struct body *body, const char *scene_text, struct resume *resume,
                 struct failure *why)
{
    const struct mesh *m = &body->mesh;
    size_t used = (size_t)snprintf(resume->path, sizeof resume->path, "%s.part", bank_path);
    if (used >= sizeof resume->path)
        return failure_set(why, STATUS_FILE_WRITE, bank_path, "name another file to write", "the path is too long");
    const struct {
        const void *bytes;
        size_t length;
    } part[] = {{MARK, sizeof MARK},
                {scene_text, strlen(scene_text) + 1},
                {&m->file_hash, sizeof m->file_hash},
                {&m->node_count, sizeof m->node_count},
                {m->nodes, 3 * m->node_count * sizeof *m->nodes},
                {m->tetrahedra, 4 * m->tetrahedron_count * sizeof *m->tetrahedra},
                {m->labels, m->tetrahedron_count * sizeof *m->labels}};
    EVP_MD_CTX *hash = EVP_MD_CTX_new();
    bool good = hash && EVP_DigestInit_ex(hash, EVP_sha256(), NULL);
    for (size_t k = 0; k < sizeof part / sizeof part[0] && good; k++)
        good = EVP_DigestUpdate(hash, part[k].bytes, part[k].length);
    for (size_t k = 0; k < m->label_count && good; k++)
        good = EVP_DigestUpdate(hash, m->label[k].name, strlen(m->label[k].name) + 1) &&
               EVP_DigestUpdate(hash, &m->label[k].number, sizeof m->label[k].number);
    good = good && EVP_DigestFinal_ex(hash, resume->key, NULL);
    EVP_MD_CTX_free(hash);
    struct head head;
    if (look(resume, &head) == STRANGER)
        *resume->path = 0;
    return good ? STATUS_OK : failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to sum the body");
}

static bool take(FILE *file, void *bytes, size_t length, uint32_t *crc)
{
    if (fread(bytes, 1, length, file) != length)
        return false;
    *crc = (uint32_t)crc32_z(*crc, bytes, length);
    return true;
}

static bool read_all(FILE *file, const struct resume *resume, size_t vertices, struct compliance *c)
{
    struct head head;
    uint32_t crc = 0, stored;
    if (!take(file, &head, sizeof head, &crc) || memcmp(head.mark, MARK, sizeof MARK) != 0 ||
        memcmp(head.key, resume->key, sizeof head.key) != 0 || head.vertices != vertices || head.rows > vertices)
        return false;
    size_t ld = 3 * (size_t)head.rows;
    *c = (struct compliance){.rows = (size_t)head.rows, .median_diagonal_m_N = head.median_m_N};
    c->row_of = malloc((vertices + 1) * sizeof *c->row_of);
    c->G = calloc(ld * ld + 1, sizeof *c->G);
    if (!c->row_of || !c->G || !take(file, c->row_of, vertices * sizeof *c->row_of, &crc))
        return false;
    for (size_t j = 0; j < ld; j++)
        if (!take(file, c->G + j * ld + j, (ld - j) * sizeof *c->G, &crc))
            return false;
    return fread(&stored, sizeof stored, 1, file) == 1 && stored == crc && fgetc(file) == EOF;
}

bool resume_load(const struct resume *resume, const struct body *body, struct compliance *c)
{
    FILE *file = *resume->path ? fopen(resume->path, "rb") : NULL;
    if (!file)
        return false;
    *c = (struct compliance){0};
    bool good = read_all(file, resume, body->surface.vertex_count, c);
    fclose(file);
    if (!good)
        compliance_free(c);
    return good;
}

bool resume_is_there(const struct resume *resume)
{
    struct head head;
    return *resume->path && look(resume, &head) == KEPT && !memcmp(head.key, resume->key, sizeof head.key);
}

static int put(struct file_writer *writer, const void *bytes, size_t length, uint32_t *crc, struct failure *why)
{
    *crc = (uint32_t)crc32_z(*crc, bytes, length);
    return file_append(writer, bytes, length, why);
}

int resume_save(const struct resume *resume, const struct body *body, const struct compliance *c, struct failure *why)
{
    struct file_writer writer;
    struct head head;
    uint32_t crc = 0;
    size_t ld = 3 * c->rows, vertices = body->surface.vertex_count;
    if (!*resume->path)
        return STATUS_OK;
    memset(&head, 0, sizeof head);
    memcpy(head.mark, MARK, sizeof MARK);
    memcpy(head.key, resume->key, sizeof head.key);
    head.rows = c->rows;
    head.vertices = vertices;
    head.median_m_N = c->median_diagonal_m_N;
    int status = file_begin(&writer, resume->path, why);
    if (!status)
        status = put(&writer, &head, sizeof head, &crc, why);
    if (!status)
        status = put(&writer, c->row_of, vertices * sizeof *c->row_of, &crc, why);
    for (size_t j = 0; j < ld && !status; j++)
        status = put(&writer, c->G + j * ld + j, (ld - j) * sizeof *c->G, &crc, why);
    if (!status)
        status = file_append(&writer, &crc, sizeof crc, why);
    if (!status)
        status = file_commit(&writer, why);
    file_abandon(&writer);
    return status;
}

void resume_end(const struct resume *resume)
{
    struct head head;
    if (*resume->path && look(resume, &head) == KEPT)
        unlink(resume->path);
}
