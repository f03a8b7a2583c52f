/* A YAML file as a tree that the scene is read from: one document, UTF-8, no aliases and no tags, bounded in size;
 * every complaint carries the line. The first complaint is kept in `status` and every later call does nothing, so that
 * a reader of many keys needs one check at its end. Built on libyaml's document API. */
#ifndef TROCAR_TREE_H
#define TROCAR_TREE_H

#include <stdbool.h>
#include <stddef.h>
#include <yaml.h>

#include "failure.h"
#include "quantity.h"

enum {
    TREE_MAX_BYTES = 262144, /* a scene is a page; more is a mistake or an attack */
    TREE_MAX_DEPTH = 64,     /* of nested [ and {: the deepest scene has 6 */
};

struct tree {
    yaml_document_t document;
    const char *path;
    struct failure *why;
    int status;
};

typedef yaml_node_t *tree_node; /* NULL: absent; the readers below then leave their result as it is */

/* Parse. On failure (negative status) nothing is left to close. */
int tree_open(struct tree *tree, const char *text, size_t length, const char *path, struct failure *why);
void tree_close(struct tree *tree);
tree_node tree_root(struct tree *tree);
long tree_line(tree_node node);

/* Complain at a node; returns the status. */
int tree_fail(struct tree *tree, tree_node node, enum status status, const char *remedy, const char *cause, ...)
    __attribute__((format(printf, 5, 6)));
/* Complain with STATUS_SCENE_VALUE unless `holds` or the node is absent. */
void tree_require(struct tree *tree, tree_node node, bool holds, const char *cause, ...)
    __attribute__((format(printf, 4, 5)));

/* `node` is a mapping that has only keys of `keys` (NULL-terminated), each once. False after any complaint. */
bool tree_map(struct tree *tree, tree_node node, const char *name, const char *const *keys);
tree_node tree_find(struct tree *tree, tree_node map, const char *key);                   /* NULL when absent */
tree_node tree_need(struct tree *tree, tree_node map, const char *name, const char *key); /* complains when absent */
bool tree_empty(struct tree *tree, tree_node node); /* {} or nothing behind the colon */

/* `node` is a list of at most `most` entries; their count. 0 after any complaint or when absent. */
size_t tree_list(struct tree *tree, tree_node node, const char *name, size_t most);
tree_node tree_item(struct tree *tree, tree_node list, size_t index);

void tree_quantity(struct tree *tree, tree_node node, const char *name, enum dimension dimension, double *value);
void tree_range(struct tree *tree, tree_node node, const char *name, enum dimension dimension, double range[2]);
void tree_vector(struct tree *tree, tree_node node, const char *name, enum dimension dimension, double vector[3]);
/* A vector of any length > 0, made a unit vector. */
void tree_direction(struct tree *tree, tree_node node, const char *name, double direction[3]);
/* Text of 1 .. size-1 bytes without control characters. */
void tree_text(struct tree *tree, tree_node node, const char *name, char *text, size_t size);
/* The same, of letters, digits, '.', '_' and '-', starting with a letter or digit: it becomes part of file names. */
void tree_name(struct tree *tree, tree_node node, const char *name, char *text, size_t size);
void tree_flag(struct tree *tree, tree_node node, const char *name, bool *flag);
/* Index of the text in `choices` (NULL-terminated), -1 after any complaint or when absent. */
int tree_choice(struct tree *tree, tree_node node, const char *name, const char *const *choices);

#endif
