#include "mesh_data.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct mesh_data *mesh_data_want(struct mesh *mesh, const char *name)
{
    struct mesh_data *known = mesh_data_wanted(mesh, name);
    if (known)
        return known;
    struct mesh_data *larger = realloc(mesh->data, (mesh->data_count + 1) * sizeof *larger);
    if (!larger)
        return NULL;
    mesh->data = larger;
    struct mesh_data *data = &larger[mesh->data_count++];
    *data = (struct mesh_data){.value = NULL};
    snprintf(data->name, sizeof data->name, "%s", name);
    return data;
}

struct mesh_data *mesh_data_wanted(struct mesh *mesh, const char *name)
{
    for (size_t i = 0; i < mesh->data_count; i++)
        if (strcmp(mesh->data[i].name, name) == 0)
            return &mesh->data[i];
    return NULL;
}

const struct mesh_data *mesh_data_find(const struct mesh *mesh, const char *name)
{
    for (size_t i = 0; i < mesh->data_count; i++)
        if (mesh->data[i].value && strcmp(mesh->data[i].name, name) == 0)
            return &mesh->data[i];
    return NULL;
}

bool mesh_data_append(struct mesh_data *data, size_t components, const double *values, size_t nodes)
{
    if (data->value && data->components != components)
        return true;
    size_t all = components * (data->nodes + nodes);
    double *larger = realloc(data->value, (all + 1) * sizeof *larger);
    if (!larger)
        return false;
    memcpy(larger + components * data->nodes, values, components * nodes * sizeof *values);
    data->value = larger;
    data->components = components;
    data->nodes += nodes;
    return true;
}

void mesh_data_settle(struct mesh *mesh)
{
    for (size_t i = 0; i < mesh->data_count; i++)
        if (mesh->data[i].nodes != mesh->node_count) {
            free(mesh->data[i].value);
            mesh->data[i].value = NULL;
            mesh->data[i].nodes = mesh->data[i].components = 0;
        }
}

void mesh_data_move(struct mesh *mesh, size_t from, size_t to)
{
    for (size_t i = 0; i < mesh->data_count; i++)
        if (mesh->data[i].value)
            memmove(mesh->data[i].value + mesh->data[i].components * to,
                    mesh->data[i].value + mesh->data[i].components * from, mesh->data[i].components * sizeof(double));
}

void mesh_data_free(struct mesh *mesh)
{
    for (size_t i = 0; i < mesh->data_count; i++)
        free(mesh->data[i].value);
    free(mesh->data);
    mesh->data = NULL;
    mesh->data_count = 0;
}
