#include "tree.h"

#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

long tree_line(tree_node node)
{
    return node ? (long)node->start_mark.line + 1 : 0;
}

int tree_fail(struct tree *tree, tree_node node, enum status status, const char *remedy, const char *cause, ...)
{
    if (tree->status)
        return tree->status;
    char text[400];
    va_list arguments;
    va_start(arguments, cause);
    vsnprintf(text, sizeof text, cause, arguments);
    va_end(arguments);
    tree->status = failure_at(tree->why, status, tree->path, tree_line(node), remedy, "%s", text);
    return tree->status;
}

void tree_require(struct tree *tree, tree_node node, bool holds, const char *cause, ...)
{
    if (tree->status || holds || !node)
        return;
    char text[400];
    va_list arguments;
    va_start(arguments, cause);
    vsnprintf(text, sizeof text, cause, arguments);
    va_end(arguments);
    tree_fail(tree, node, STATUS_SCENE_VALUE, NULL, "%s", text);
}

static long line_of_byte(const char *text, size_t length, size_t byte)
{
    long line = 1;
    for (size_t i = 0; i < byte && i < length; i++)
        line += text[i] == '\n';
    return line;
}

/* libyaml's complaint in our form. */
static int complain(struct tree *tree, const yaml_parser_t *parser, const char *text, size_t length)
{
    if (parser->error == YAML_MEMORY_ERROR)
        return failure_set(tree->why, STATUS_MEMORY, tree->path, NULL, "no memory to read the scene");
    const char *problem = parser->problem ? parser->problem : "it cannot be read";
    if (parser->error == YAML_READER_ERROR)
        return failure_at(tree->why, STATUS_SCENE_SYNTAX, tree->path,
                          line_of_byte(text, length, parser->problem_offset), "save the file as UTF-8 text",
                          "byte %zu: %s", parser->problem_offset, problem);
    return failure_at(tree->why, STATUS_SCENE_SYNTAX, tree->path, (long)parser->problem_mark.line + 1, NULL, "%s%s%s",
                      parser->context ? parser->context : "", parser->context ? ": " : "", problem);
}

/* Nesting is counted on events first: the loader and its error paths then never meet a tower of brackets. */
static int check_depth(struct tree *tree, const char *text, size_t length)
{
    yaml_parser_t parser;
    if (!yaml_parser_initialize(&parser))
        return failure_set(tree->why, STATUS_MEMORY, tree->path, NULL, "no memory to read the scene");
    yaml_parser_set_input_string(&parser, (const unsigned char *)text, length);
    yaml_parser_set_encoding(&parser, YAML_UTF8_ENCODING);
    int status = STATUS_OK, depth = 0;
    for (bool more = true; more && !status;) {
        yaml_event_t event;
        if (!yaml_parser_parse(&parser, &event)) {
            status = complain(tree, &parser, text, length);
            break;
        }
        long line = (long)event.start_mark.line + 1;
        if (event.type == YAML_SEQUENCE_START_EVENT || event.type == YAML_MAPPING_START_EVENT)
            depth++;
        if (event.type == YAML_SEQUENCE_END_EVENT || event.type == YAML_MAPPING_END_EVENT)
            depth--;
        if (depth > TREE_MAX_DEPTH)
            status = failure_at(tree->why, STATUS_SCENE_SYNTAX, tree->path, line, NULL,
                                "more than %d levels of nesting", TREE_MAX_DEPTH);
        else if (event.type == YAML_ALIAS_EVENT)
            status = failure_at(tree->why, STATUS_SCENE_SYNTAX, tree->path, line, "write the value out",
                                "a scene has no aliases ('*%.40s')", (const char *)event.data.alias.anchor);
        more = event.type != YAML_STREAM_END_EVENT;
        yaml_event_delete(&event);
    }
    yaml_parser_delete(&parser);
    return status;
}

static int check_tags(struct tree *tree)
{
    for (yaml_node_t *n = tree->document.nodes.start; n < tree->document.nodes.top; n++) {
        const char *plain = n->type == YAML_MAPPING_NODE    ? YAML_DEFAULT_MAPPING_TAG
                            : n->type == YAML_SEQUENCE_NODE ? YAML_DEFAULT_SEQUENCE_TAG
                                                            : YAML_DEFAULT_SCALAR_TAG;
        if (n->tag && strcmp((const char *)n->tag, plain) != 0)
            return tree_fail(tree, n, STATUS_SCENE_SYNTAX, "remove the tag", "a scene has no tags ('%.60s')",
                             (const char *)n->tag);
    }
    return STATUS_OK;
}

int tree_open(struct tree *tree, const char *text, size_t length, const char *path, struct failure *why)
{
    *tree = (struct tree){.path = path, .why = why};
    if (length > TREE_MAX_BYTES)
        return failure_at(why, STATUS_SCENE_SYNTAX, path, 0, "give a scene, not a mesh or a bank",
                          "the file is larger than the %d bytes that a scene may have", TREE_MAX_BYTES);
    if (length >= 3 && memcmp(text, "\xEF\xBB\xBF", 3) == 0) { /* some editors put a byte order mark */
        text += 3;
        length -= 3;
    }
    int status = check_depth(tree, text, length);
    if (status)
        return status;
    yaml_parser_t parser;
    if (!yaml_parser_initialize(&parser))
        return failure_set(why, STATUS_MEMORY, path, NULL, "no memory to read the scene");
    yaml_parser_set_input_string(&parser, (const unsigned char *)text, length);
    yaml_parser_set_encoding(&parser, YAML_UTF8_ENCODING);
    if (!yaml_parser_load(&parser, &tree->document)) {
        status = complain(tree, &parser, text, length);
        yaml_parser_delete(&parser);
        return status;
    }
    tree_node root = tree_root(tree);
    if (!root) {
        status = failure_at(why, STATUS_SCENE_MISSING, path, 0, "start from the scene that trocar build prints",
                            "the file holds no scene");
    } else {
        yaml_document_t second;
        if (!yaml_parser_load(&parser, &second)) {
            status = complain(tree, &parser, text, length);
        } else {
            tree_node extra = yaml_document_get_root_node(&second);
            if (extra)
                status = failure_at(why, STATUS_SCENE_SYNTAX, path, tree_line(extra), "keep one document per file",
                                    "a second document starts here");
            yaml_document_delete(&second);
        }
    }
    yaml_parser_delete(&parser);
    if (!status)
        status = check_tags(tree);
    if (status)
        yaml_document_delete(&tree->document);
    return status;
}

void tree_close(struct tree *tree)
{
    yaml_document_delete(&tree->document);
}

tree_node tree_root(struct tree *tree)
{
    return yaml_document_get_root_node(&tree->document);
}

/* A scalar's text, or NULL. Its bytes may hold a NUL (from "\0" in quotes): such a text matches nothing. */
static const char *scalar(tree_node node)
{
    if (!node || node->type != YAML_SCALAR_NODE ||
        strlen((const char *)node->data.scalar.value) != node->data.scalar.length)
        return NULL;
    return (const char *)node->data.scalar.value;
}

/* Edits (insert, delete, replace) that turn a into b; both at most 31 bytes, else 99. */
static int edits(const char *a, const char *b)
{
    size_t m = strlen(a), n = strlen(b);
    int row[32];
    if (m > 31 || n > 31)
        return 99;
    for (size_t j = 0; j <= n; j++)
        row[j] = (int)j;
    for (size_t i = 1; i <= m; i++) {
        int diagonal = row[0];
        row[0] = (int)i;
        for (size_t j = 1; j <= n; j++) {
            int change = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = row[j];
            int skip = (row[j] < row[j - 1] ? row[j] : row[j - 1]) + 1;
            row[j] = change < skip ? change : skip;
        }
    }
    return row[n];
}

/* "did you mean 'X'?" when one word is near, else all words. */
static void suggest(const char *word, const char *const *known, char *text, size_t size)
{
    int best = 99;
    const char *nearest = NULL;
    for (const char *const *k = known; *k; k++)
        if (edits(word, *k) < best) {
            best = edits(word, *k);
            nearest = *k;
        }
    if (nearest && best <= 1 + (int)strlen(nearest) / 3 && best < (int)strlen(nearest)) {
        snprintf(text, size, "did you mean '%s'?", nearest);
        return;
    }
    size_t used = (size_t)snprintf(text, size, "known here:");
    for (const char *const *k = known; *k && used < size; k++)
        used += (size_t)snprintf(text + used, size - used, "%s %s", k == known ? "" : ",", *k);
}

bool tree_map(struct tree *tree, tree_node node, const char *name, const char *const *keys)
{
    if (tree->status || !node)
        return false;
    if (node->type != YAML_MAPPING_NODE) {
        tree_fail(tree, node, STATUS_SCENE_VALUE, "write {key: value, ...}", "%s is not a mapping", name);
        return false;
    }
    uint64_t seen = 0; /* bit per known key; no mapping of a scene has more than 64 */
    for (yaml_node_pair_t *p = node->data.mapping.pairs.start; p < node->data.mapping.pairs.top; p++) {
        tree_node key = yaml_document_get_node(&tree->document, p->key);
        const char *text = scalar(key);
        if (!text) {
            tree_fail(tree, key, STATUS_SCENE_KEY, NULL, "%s has a key that is not a word", name);
            return false;
        }
        int k = 0;
        while (keys[k] && strcmp(keys[k], text) != 0)
            k++;
        if (!keys[k]) {
            char remedy[300];
            suggest(text, keys, remedy, sizeof remedy);
            tree_fail(tree, key, STATUS_SCENE_KEY, remedy, "unknown key '%.60s' in %s", text, name);
            return false;
        }
        if (seen & (uint64_t)1 << k) {
            tree_fail(tree, key, STATUS_SCENE_KEY, "keep one of them", "the key '%s' stands twice in %s", text, name);
            return false;
        }
        seen |= (uint64_t)1 << k;
    }
    return true;
}

tree_node tree_find(struct tree *tree, tree_node map, const char *key)
{
    if (tree->status || !map || map->type != YAML_MAPPING_NODE)
        return NULL;
    for (yaml_node_pair_t *p = map->data.mapping.pairs.start; p < map->data.mapping.pairs.top; p++) {
        const char *text = scalar(yaml_document_get_node(&tree->document, p->key));
        if (text && strcmp(text, key) == 0)
            return yaml_document_get_node(&tree->document, p->value);
    }
    return NULL;
}

tree_node tree_need(struct tree *tree, tree_node map, const char *name, const char *key)
{
    tree_node node = tree_find(tree, map, key);
    if (!node && !tree->status)
        tree_fail(tree, map, STATUS_SCENE_MISSING, NULL, "%s needs the key '%s'", name, key);
    return node;
}

bool tree_empty(struct tree *tree, tree_node node)
{
    (void)tree;
    if (!node)
        return true;
    if (node->type == YAML_MAPPING_NODE)
        return node->data.mapping.pairs.top == node->data.mapping.pairs.start;
    return node->type == YAML_SCALAR_NODE && node->data.scalar.length == 0;
}

size_t tree_list(struct tree *tree, tree_node node, const char *name, size_t most)
{
    if (tree->status || !node)
        return 0;
    if (node->type != YAML_SEQUENCE_NODE) {
        tree_fail(tree, node, STATUS_SCENE_VALUE, "write [..., ...]", "%s is not a list", name);
        return 0;
    }
    size_t count = (size_t)(node->data.sequence.items.top - node->data.sequence.items.start);
    tree_require(tree, node, count <= most, "%s has %zu entries; at most %zu are possible", name, count, most);
    return tree->status ? 0 : count;
}

tree_node tree_item(struct tree *tree, tree_node list, size_t index)
{
    return yaml_document_get_node(&tree->document, list->data.sequence.items.start[index]);
}

/* The text of a node that must be a single value. */
static const char *value_text(struct tree *tree, tree_node node, const char *name)
{
    if (tree->status || !node)
        return NULL;
    const char *text = scalar(node);
    if (!text)
        tree_fail(tree, node, STATUS_SCENE_VALUE, NULL, "%s is not a single value", name);
    return text;
}

void tree_quantity(struct tree *tree, tree_node node, const char *name, enum dimension dimension, double *value)
{
    char message[300];
    double read = 0;
    const char *text = value_text(tree, node, name);
    if (!text)
        return;
    int status = quantity_parse(text, dimension, &read, message, sizeof message);
    if (status)
        tree_fail(tree, node, (enum status)status, NULL, "%s: %s", name, message);
    else
        *value = read;
}

void tree_range(struct tree *tree, tree_node node, const char *name, enum dimension dimension, double range[2])
{
    char message[300];
    double read[2] = {0};
    const char *text = value_text(tree, node, name);
    if (!text)
        return;
    int status = quantity_parse_range(text, dimension, read, message, sizeof message);
    if (status)
        tree_fail(tree, node, (enum status)status, NULL, "%s: %s", name, message);
    else
        memcpy(range, read, sizeof read);
}

void tree_vector(struct tree *tree, tree_node node, const char *name, enum dimension dimension, double vector[3])
{
    if (tree->status || !node)
        return;
    size_t count = tree_list(tree, node, name, 3);
    tree_require(tree, node, count == 3, "%s has %zu components; [x, y, z] are needed", name, count);
    for (size_t i = 0; i < 3 && !tree->status; i++)
        tree_quantity(tree, tree_item(tree, node, i), name, dimension, &vector[i]);
}

void tree_direction(struct tree *tree, tree_node node, const char *name, double direction[3])
{
    if (tree->status || !node)
        return;
    double v[3] = {0};
    tree_vector(tree, node, name, DIMENSION_NUMBER, v);
    double length = hypot(hypot(v[0], v[1]), v[2]);
    tree_require(tree, node, length > 0 && isfinite(length), "%s = [%g, %g, %g] has no direction", name, v[0], v[1],
                 v[2]);
    /* A vector that is a unit vector already stays as it is, to the bit: a printed scene reads back the same. */
    bool unit = fabs(length - 1) < 1e-15;
    for (int i = 0; i < 3 && !tree->status; i++)
        direction[i] = unit ? v[i] : v[i] / length + 0.0; /* + 0.0: there is one zero, not -0 */
}

void tree_text(struct tree *tree, tree_node node, const char *name, char *text, size_t size)
{
    const char *value = value_text(tree, node, name);
    if (!value)
        return;
    size_t length = strlen(value);
    bool clean = true;
    for (size_t i = 0; i < length; i++)
        clean &= (unsigned char)value[i] >= 32 && value[i] != 127;
    tree_require(tree, node, length > 0, "%s is empty", name);
    tree_require(tree, node, length < size, "%s has %zu bytes; at most %zu are possible", name, length, size - 1);
    tree_require(tree, node, clean, "%s has control characters", name);
    if (!tree->status)
        memcpy(text, value, length + 1);
}

void tree_name(struct tree *tree, tree_node node, const char *name, char *text, size_t size)
{
    tree_text(tree, node, name, text, size);
    if (tree->status || !node)
        return;
    static const char allowed[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-";
    tree_require(tree, node, strspn(text, allowed) == strlen(text) && !strchr("._-", text[0]),
                 "%s '%.63s' is not a name: letters, digits, '.', '_' and '-', starting with a letter or digit", name,
                 text);
}

void tree_flag(struct tree *tree, tree_node node, const char *name, bool *flag)
{
    static const char *const choices[] = {"false", "true", NULL};
    int index = tree_choice(tree, node, name, choices);
    if (index >= 0)
        *flag = index == 1;
}

int tree_choice(struct tree *tree, tree_node node, const char *name, const char *const *choices)
{
    const char *text = value_text(tree, node, name);
    if (!text)
        return -1;
    for (int i = 0; choices[i]; i++)
        if (strcmp(text, choices[i]) == 0)
            return i;
    char remedy[300];
    suggest(text, choices, remedy, sizeof remedy);
    tree_fail(tree, node, STATUS_SCENE_VALUE, remedy, "%s '%.60s' is not offered", name, text);
    return -1;
}
