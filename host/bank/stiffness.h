/* Assembly of the sparse stiffness matrix K over the free components. */
#ifndef TROCAR_STIFFNESS_H
#define TROCAR_STIFFNESS_H

#include <cholmod.h>

#include "element.h"
#include "failure.h"
#include "hooke.h"
#include "space.h"

/* Springs to the ground at the nodes of the space: 6 per node, xx yy zz xy xz yz of the tensor k n (x) n, N/m. */
struct springs {
    double (*tensor)[6]; /* NULL when there are none */
};

/* Lower half of K for either order of elements, packed and sorted columns, for CHOLMOD. `unknown` has 3 per node: the number of the free component
 * or -1; numbers must rise with node and component. `material` is by element through `material_of`. K is gathered node
 * by node (count, prefix sum, fill), so no triplet list exists: 12 bytes per entry plus about 200 per element.
 * STATUS_MEMORY is the only failure. */
int stiffness_assemble(const struct space *space, const struct hooke *material, const uint32_t *material_of,
                       const int32_t *unknown, size_t unknowns, struct springs springs, cholmod_common *common,
                       cholmod_sparse **K, struct failure *why);

#endif
