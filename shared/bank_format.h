/* The bank, format version 1: what a controller reads in place from flash. SPEC.md says every bit; this header is the
 * same layout as C. Little-endian; integers and IEEE 754 float32 only; every section starts at a multiple of 16 bytes.
 *
 *   header (64 bytes) | section table (32 bytes each) | section | section | ...
 *
 * Every byte of the file is under one CRC-32: the header's own, the table's, or that of a section (over its length
 * rounded up to 16; the padding is zero). A reader validates once (bank_view_open), then reads without checks.
 *
 * New data join as new sections. A section with BANK_REQUIRED that the reader does not know refuses the bank; without
 * it, the section is skipped. The header never changes within a format version. */
#ifndef TROCAR_BANK_FORMAT_H
#define TROCAR_BANK_FORMAT_H

#include <stdint.h>

#define BANK_TAG(a, b, c, d) ((uint32_t)(a) | (uint32_t)(b) << 8 | (uint32_t)(c) << 16 | (uint32_t)(d) << 24)
#define BANK_MAGIC           BANK_TAG('T', 'R', 'C', 'B')

enum {
    BANK_FORMAT_VERSION = 1,
    BANK_ALIGNMENT = 16,
    BANK_MAX_SECTIONS = 64,
    BANK_MAX_VERTICES = 65534, /* indices are uint16; 0xFFFF means none */
    BANK_MAX_TRIANGLES = 65534,
    BANK_NONE = 0xFFFF,
    BANK_MAX_TOOL_POINTS = 16,
    BANK_MAX_INSTRUMENTS = 2,
    BANK_MAX_GRID_CELLS = 65536,
    BANK_MAX_GRID_AXIS = 1024, /* cells along one axis: float32 still tells 1e-4 of a cell apart */
    BANK_MAX_CELL_TRIANGLES = 255,
    BANK_MAX_COUNTS = 16384,    /* modulus of an encoder: 14 bits on the bus */
    BANK_MAX_SOLVER_STEPS = 48, /* factorisations of the contact solver in one tick */
    BANK_MAX_ROW_WORK = 1000,   /* thousands of units: firmware/row_cache.h */
    BANK_ROW_WORK_UNIT = 1000
};

#define BANK_MAX_ANGLE_RAD                                                                                             \
    0.7f                         /* of alpha and beta: 5 % of the range beyond it, sin^2 a + sin^2 b is still below 1  \
                                  */
#define BANK_MAX_POSITION_M 1e3f /* of any coordinate */

enum {
    BANK_REQUIRED = 1, /* flags: a reader that does not know this tag must refuse the bank */
    BANK_HOST_ONLY = 2 /* flags: not needed on the controller; a deployer may leave it out */
};

struct bank_header {
    uint32_t magic;          /* BANK_MAGIC */
    uint16_t format_version; /* BANK_FORMAT_VERSION */
    uint16_t header_bytes;   /* 64 */
    uint32_t total_bytes;    /* the whole file, a multiple of 16 */
    uint32_t section_count;  /* 1 .. BANK_MAX_SECTIONS */
    uint32_t image_abi;      /* lowest firmware ABI that can run this bank (FIRMWARE_ABI of firmware/tick.h) */
    uint32_t effects;        /* bit k: the effect of effects.def with that bit is needed, and its section is there */
    uint32_t scene_hash;     /* CRC-32 of the scene text in section PROV */
    uint32_t mesh_hash;      /* CRC-32 of the mesh file's bytes */
    uint32_t reserved[6];    /* 0 */
    uint32_t table_crc;      /* CRC-32 of the section table */
    uint32_t header_crc;     /* CRC-32 of the 60 bytes before it */
};

struct bank_section {
    uint32_t tag;
    uint16_t version; /* of this section's own layout */
    uint16_t flags;   /* BANK_REQUIRED, BANK_HOST_ONLY */
    uint32_t offset;  /* from the start of the file; multiple of 16; sections follow each other without gaps */
    uint32_t length;  /* bytes, without the padding */
    uint32_t count;   /* records; their meaning is the section's */
    uint32_t crc;     /* CRC-32 of the length rounded up to 16 */
    uint32_t reserved[2];
};

/* VERT, required: rest positions of the surface vertices, count x 3 float32, m. */
#define BANK_VERT BANK_TAG('V', 'E', 'R', 'T')
/* NORM, required: outward unit normals at the vertices (angle-weighted), count x 3 float32. Contact uses their linear
 * interpolation, which is continuous over the surface where face normals jump. */
#define BANK_NORM BANK_TAG('N', 'O', 'R', 'M')

/* TRIA, required: count x struct bank_triangle. Vertices run counter-clockwise seen from outside. */
#define BANK_TRIA BANK_TAG('T', 'R', 'I', 'A')
struct bank_triangle {
    uint16_t vertex[3];
    uint16_t neighbour[3]; /* triangle across the edge opposite vertex k */
};

/* GRID, required, version 2: uniform grid over the surface's box. struct bank_grid, then uint32 base[cells / 32 + 1], then
 * uint16 start[cells + 1], then uint16 triangle numbers: cell c = x + nx (y + ny z) holds the entries from base[c / 32] +
 * start[c] up to the next cell's, in rising order. count = cells.
 * A triangle is listed at least in every cell that, enlarged by 1e-3 of a cell on each side, it meets (so rounding in
 * the traversal loses nothing); every vertex lies inside the grid. */
#define BANK_GRID BANK_TAG('G', 'R', 'I', 'D')
struct bank_grid {
    float origin_m[3];
    float cell_m;         /* cells are cubes */
    uint16_t cells[3];    /* nx, ny, nz; product <= BANK_MAX_GRID_CELLS */
    uint16_t max_in_cell; /* longest cell list, <= BANK_MAX_CELL_TRIANGLES: the bound of the inner loop */
    uint32_t entries;     /* triangle numbers in all */
    uint32_t reserved;
};

/* ROWS, required: per vertex the row of the compliance it owns, uint16, BANK_NONE for a fixed vertex. count = vertices.
 */
#define BANK_ROWS BANK_TAG('R', 'O', 'W', 'S')

/* GHLF, required unless FACT is present: the compliance (Green's function) on the surface, plain.
 * count = rows n. Lower half by rows: row i holds the blocks (i,0) .. (i,i), each 3x3 row-major float32, m/N; block
 * (i,j) starts at float 9 (i (i+1)/2 + j). Block (j,i) is the transpose of (i,j). Component a of the displacement of
 * row i under a force F on row j is sum_b G[i][j][a][b] F_b. */
#define BANK_GHLF BANK_TAG('G', 'H', 'L', 'F')

/* FACT, required unless GHLF is present (exactly one of the two is), version 2: the compliance as the square of a rounded
 * factor. count = rows n, in an order from coarse to fine. G = step^2 Q Q^t, where Q is a lower triangle of 3x3 blocks of
 * int16, most of them zero. A product of a matrix with its own transpose is positive semidefinite whatever Q holds, so no
 * step and no code can make a contact system indefinite.
 *
 *   struct bank_factor | 16 bit words: level_first[levels], level_log[levels], level_unit[levels], distance_unit[64],
 *   diagonal[levels] (struct bank_context), context[levels][classes] (struct bank_context), table[BANK_FACTOR_TABLES] (struct bank_table), place[n][3],
 *   base[n / 32 + 1][2], offset[n + 1], code, BANK_FACTOR_SPARE times 0
 *
 * place: integer coordinates of the row's vertex, 0 .. 32767, one unit for the three axes. ilog(x) = 2 e + b, e the highest
 * set bit of x and b the bit below, where x has its lowest bit set. The rows of one level l, level_first[l] .. level_first[l+1] - 1, keep about
 * one distance from the coarser ones; level_log is the ilog() of its square. With D = place_i - place_j and log = ilog(D.D),
 * column j of row i has the class log - level_log[l], l the level of j; at least 0. From `classes` on its block is zero and
 * takes no code. Below, the block is multiple (prediction + residual), with context[l][class]:
 *
 *   multiple    row_multiple(level_unit[l], distance_unit[log]): what is far or coarse is kept less finely
 *   prediction  about (k0 [a = b] + k1 D_a D_b / D.D) / 8 with k = kernel, in integers as written in row_kernel() of
 *               firmware/row_code.h: the form of an elastic point response
 *   residual    coded, with `code`: bits 0..7 g, the probability of "not all zero" is (16 g + 8) / 4096; bits 8..11 the table
 *               for the block's diagonal, 12..15 beside it
 *
 * The block (i, i) has no prediction, the multiple row_multiple(level_unit[l], diagonal_unit) and diagonal[l], l the level
 * of i.
 *
 * Code of row i: words base[i / 32] (low, high) + offset[i] up to the next row's; an rANS stream (32 bit state, first two
 * words, low first; renormalised by a word when below 2^16; frequencies of 12 bits; it ends with the state 2^16). For each
 * column j < i that has a class below `classes`: the bit "not all zero", then three values for the diagonal (00, 11, 22),
 * three above it (01, 02, 12), three below (10, 20, 21); at j = i three and three below it, without that bit. Tables are
 * ordered by how large their values are; the table of the second three (and then of the third) is the one below or above
 * the one that is due when the symbols of the three before sum up to less than their table's `low`, to its `high` or more
 * (row_next_table()). Below the diagonal the residual is the value + row_turned(residual across, turn).
 *
 * A value is a number: 0, -1, 1, -2, 2, ... are 0, 1, 2, 3, 4, ... The code of three is their three symbols s, then for each
 * its plain bits b, `plain` of them: the number is s 2^plain + b. For symbol 15 there stand 4 plain bits e and e more, m,
 * before b: (14 + 2^e + m) 2^plain + b. The words at the end are there so that a reader of damaged code need look for the
 * end of a row once a block. */
#define BANK_FACT BANK_TAG('F', 'A', 'C', 'T')
enum {
    BANK_FACTOR_LEVELS = 32,
    BANK_FACTOR_CLASSES = 40,
    BANK_FACTOR_TABLES = 16,
    BANK_FACTOR_SYMBOLS = 16,
    BANK_FACTOR_BITS = 12,  /* of a frequency */
    BANK_FACTOR_PLAIN = 12, /* most plain bits of a table */
    BANK_FACTOR_SPARE = 40  /* words: more than the code of a block */
};
struct bank_factor {
    float step;             /* (m/N)^(1/2) */
    uint16_t max_blocks;    /* of the longest row */
    uint8_t levels;         /* 1 .. BANK_FACTOR_LEVELS */
    uint8_t classes;        /* 1 .. BANK_FACTOR_CLASSES */
    uint16_t diagonal_unit; /* see row_multiple() */
    uint16_t reserved[3];
};
struct bank_context {
    uint16_t code;
    int16_t turn, kernel[2];
};
struct bank_table {
    uint16_t plain;                      /* 0 .. BANK_FACTOR_PLAIN */
    uint16_t low, high;                  /* of the sum of three symbols */
    uint16_t upper[BANK_FACTOR_SYMBOLS]; /* symbol s has the slots upper[s - 1] .. upper[s] - 1; the last is 4096 */
};

/* CONT, required, count = 1: how contact is rendered. */
#define BANK_CONT        BANK_TAG('C', 'O', 'N', 'T')
#define BANK_MAX_DECAY_S 0.5f /* torque is gone within ten of these, whatever the bank says */
struct bank_contact {
    float regularisation_m_N;     /* epsilon of contact.h, > 0: 1e-3 of the median G_ii */
    float coupling_stiffness_N_m; /* virtual coupling between device and proxy; the hand never feels more */
    float coupling_damping_Ns_m;  /* of the virtual coupling, while in contact */
    float force_limit_N;          /* clamp of the tip force */
    float force_rate_N_s;         /* rate limit of the tip force, per second */
    float decay_s;                /* time constant of the decay to zero in the state SAFE */
    float typical_compliance_m_N; /* median diagonal of G: for display and scaling */
    uint16_t solver_steps;        /* factorisations after which the contact solver stops; 0: BANK_MAX_SOLVER_STEPS */
    uint16_t row_work; /* BANK_ROW_WORK_UNIT units that a tick may spend on rows of FACT; 0: the image's own bound */
};

/* TOOL, required, count = instruments (1 .. BANK_MAX_INSTRUMENTS): struct bank_tool each. */
#define BANK_TOOL BANK_TAG('T', 'O', 'O', 'L')
struct bank_axis {
    float per_count; /* rad or m per encoder count, signed */
    float zero;      /* rad or m at count_zero */
    uint16_t count_zero;
    uint16_t count_modulus; /* the encoder wraps at this many counts (<= 16384) */
    float minimum, maximum; /* rad or m: range of the joint; outside by more than 5 % of the range is implausible */
    float speed_limit;      /* rad/s or m/s: faster is implausible */
    float effort_limit;     /* N m or N: clamp of the motor command */
};
struct bank_tool {
    float trocar_m[3]; /* the fixed point, world */
    float rotation[9]; /* row-major; columns are the trocar frame's X, Y, Z in the world; Z points into the body */
    struct bank_axis axis[3];   /* alpha, beta (rad about the frame's zero), insertion (m) */
    float gravity_N;            /* weight of the motor carried on the instrument's axis [C97 7.2] */
    float gravity_arm_m;        /* its distance behind the trocar */
    float gravity_direction[3]; /* unit vector, world */
    float tip_radius_m;         /* the radius of the tip that the points sample */
    uint32_t point_count;       /* 1 .. BANK_MAX_TOOL_POINTS */
    float point_m[BANK_MAX_TOOL_POINTS]
                 [3]; /* offsets from the tip's centre, in the instrument's frame (Z along the shaft) */
    uint32_t reserved[4];
};

/* SCND, present exactly when the effect second is named, count = 1: two instruments in one body. TOOL has two records exactly then. */
#define BANK_SCND BANK_TAG('S', 'C', 'N', 'D')
struct bank_second {
    uint32_t points[2]; /* point_count of each TOOL record; together at most BANK_MAX_TOOL_POINTS */
    uint32_t reserved[2];
};

/* FRIC, present exactly when the effect friction is named, count = 1: Coulomb friction. */
#define BANK_FRIC         BANK_TAG('F', 'R', 'I', 'C')
#define BANK_MAX_FRICTION 2.0f /* beyond it the local problem of a contact may have several answers */
#define BANK_MAX_SWEEPS   64
struct bank_friction {
    float mu;             /* above 0, to BANK_MAX_FRICTION */
    uint32_t sweeps;      /* 1 .. BANK_MAX_SWEEPS: after which the solver of a tick stops */
    uint32_t reserved[2]; /* 0 */
};

/* GRSP, present exactly when the effect grasp is named, count = 1: jaws that hold. */
#define BANK_GRSP     BANK_TAG('G', 'R', 'S', 'P')
#define BANK_MAX_GRIP 63 /* the grip's count on the bus has 6 bits; larger is more closed */
struct bank_grasp {
    uint32_t close_count, open_count; /* the jaws close at or above the one, open at or below the other; open < close */
    float slip_N;                     /* above 0: the most that one point holds */
    uint32_t sweeps;                  /* 1 .. BANK_MAX_SWEEPS */
};

/* SHAP, present exactly when the effect shape is named, count = cells: this record, then per cell two uint16, triangles of which
 * one is the nearest to the cell's middle and the other the nearest of those that face the other way, BANK_NONE where there is
 * none within band_m and half the cell's diagonal. Cell c = x + nx (y + ny z). The points of all instruments, one instrument
 * after the other, are spheres; their place takes that of TOOL's point_m. */
#define BANK_SHAP            BANK_TAG('S', 'H', 'A', 'P')
#define BANK_MAX_OPENING_RAD 1.5707964f /* of one jaw: pi/2 as rounded */
#define BANK_MIDDLE_ROLL     512        /* count of roll at which the shaft is not turned; a turn has twice as many */
struct bank_sphere {
    float
        centre_m[3]; /* in the instrument's frame, origin at the tip, Z along the shaft; on a jaw: of the jaw's hinge */
    float radius_m;  /* 0 to band_m */
    float along_m;   /* from the hinge along the jaw; 0 on the shaft */
    float side;      /* -1 or 1: which jaw, opening towards -X or X; 0 on the shaft */
    uint32_t reserved[2]; /* 0 */
};
struct bank_shape {
    float band_m; /* a sphere's centre has a seed to this distance outside the surface; above 0 */
    float origin_m[3];
    float cell_m;
    uint16_t cells[3]; /* nx, ny, nz; product <= BANK_MAX_GRID_CELLS */
    uint16_t reserved; /* 0 */
    float opening_rad
        [BANK_MAX_INSTRUMENTS]; /* of one jaw from the shaft's axis at the grip's count 0: 0 to BANK_MAX_OPENING_RAD */
    uint32_t zero[3];
    struct bank_sphere sphere[BANK_MAX_TOOL_POINTS]; /* 0 beyond the last point */
};

/* RIGD, present exactly when the effect rigid is named, count = obstacles: struct bank_rigid, then count struct bank_obstacle. */
#define BANK_RIGD        BANK_TAG('R', 'I', 'G', 'D')
#define BANK_MIN_SHAFT_M 1e-3f /* ten times what two shafts sink into each other when they are pressed 10 cm deep */
enum { BANK_MAX_OBSTACLES = 8, BANK_MAX_OBSTACLE_POINTS = 16 };
struct bank_rigid {
    uint32_t obstacles;                         /* = count */
    float shaft_radius_m[BANK_MAX_INSTRUMENTS]; /* of each instrument, BANK_MIN_SHAFT_M to 1 */
    float cannula_radius_m;                     /* outside, at least that of the shafts; 0: there is none */
    float cannula_inside_m;                     /* how far it reaches beyond the trocar along the instrument, 0 to 1 */
    uint32_t reserved[3];                       /* 0 */
};
struct bank_obstacle {
    float radius_m;                             /* swept around the hull, 0 to 1 */
    uint32_t points;                            /* of the hull, 1 .. BANK_MAX_OBSTACLE_POINTS */
    uint32_t reserved[2];                       /* 0 */
    float point_m[BANK_MAX_OBSTACLE_POINTS][3]; /* world; unused ones 0 */
};

/* SWNG, present exactly when the effect swing is named, count = modes: struct bank_swing, then per mode and vertex 3 float32, the
 * mode's share s of the displacement, (m/N)^(1/2): the compliance holds the sum of s s'. */
#define BANK_SWNG      BANK_TAG('S', 'W', 'N', 'G')
#define BANK_MAX_MODES 8
struct bank_mode {
    /* a tick of z'' + 2 zeta omega z' + omega^2 z = omega^2 g, w = z' / omega, each 0 .. 1:
     * z += drive (g - z) + glide w, w += pull (g - z) - drag w */
    float drive, glide, pull, drag;
    float affine[12]; /* row-major 3 x 4: s = affine (x, y, z, 1) as a map of space, for the tool's points */
};
struct bank_swing {
    uint32_t modes;                        /* = count, to BANK_MAX_MODES */
    uint32_t reserved[3];                  /* 0 */
    struct bank_mode mode[BANK_MAX_MODES]; /* 0 beyond `modes` */
};

/* VISC, present exactly when the effect viscoelastic is named: this record, then count = branches branches. */
#define BANK_VISC         BANK_TAG('V', 'I', 'S', 'C')
#define BANK_MAX_BRANCHES 8
#define BANK_MAX_GAIN     1000.0f
struct bank_branch {
    float decay;  /* a = exp(-T/tau) with T = 1 ms: 0 to below 1; 0 for a dashpot */
    float gain;   /* c = g tau (1 - a)/T, above 0; all together at most BANK_MAX_GAIN */
    float share;  /* g, of the equilibrium modulus; 0 for a dashpot. For the host, as time_s is */
    float time_s; /* tau; for a dashpot its viscosity over the equilibrium modulus */
};
struct bank_viscoelastic {
    uint32_t branches;    /* 1 .. BANK_MAX_BRANCHES */
    float reach_m;        /* a point that left remembers its tissue to within this distance of where it left */
    uint32_t reserved[2]; /* 0 */
    struct bank_branch branch[];
};

/* NEOH, present exactly when the effect neo_hookean is named: this record, then per vertex, count = vertices, the cubic part of the
 * body's energy under a tool there that pushes, in linear elasticity, with the force (x, y, z): T = unit_m_N2 times the sum of
 * `cubic` times xxx yyy zzz xxy xxz yyx yyz zzx zzy xyz, J. */
#define BANK_NEOH        BANK_TAG('N', 'E', 'O', 'H')
#define BANK_MAX_CUBIC   1e9f
#define BANK_MAX_RANGE_J 1e9f
enum { BANK_CUBIC_TERMS = 10 };
struct bank_cubic {
    float unit_m_N2; /* 0 to BANK_MAX_CUBIC */
    float range_J;   /* above 0: up to this Q, force times displacement of the linear answer, T is as written */
    int16_t cubic[BANK_CUBIC_TERMS];
};
struct bank_neo_hookean {
    float radius_m;       /* of the tool that T was found for */
    uint32_t reserved[3]; /* 0 */
    struct bank_cubic vertex[];
};

/* QNLC, present exactly when the effect quasi_nonlinear is named, count = 1: curves y = sum of coefficient[k - 1] (x / range)^k, k = 1 ..
 * BANK_CURVE_DEGREE, for 0 <= x <= range, along the tangent beyond; they rise everywhere. */
#define BANK_QNLC      BANK_TAG('Q', 'N', 'L', 'C')
#define BANK_MAX_CURVE 1e6f
enum { BANK_CURVE_DEGREE = 10 };
struct bank_curve {
    float range;                          /* above 0, to BANK_MAX_CURVE */
    float coefficient[BANK_CURVE_DEGREE]; /* to BANK_MAX_CURVE, either sign */
};
struct bank_quasi_nonlinear {
    uint32_t has_across;   /* 1: P is there; 0: it is all 0 */
    float sample_per_tool; /* newtons of the sample to one of the tool, above 0 */
    struct bank_curve Q;   /* N -> N: amplitude of the force along the imposed direction, linear -> corrected */
    struct bank_curve P;   /* m -> m: amplitude of the displacement across it; for the host */
};

/* PROV, optional, host only: provenance as UTF-8 text, a YAML document: keys scene (the scene's own text), mesh_path,
 * program, nodes, tetrahedra, discretisation, build_seconds, measured errors. */
#define BANK_PROV BANK_TAG('P', 'R', 'O', 'V')

/* Version of the layout of a section as described here. */
static inline uint16_t bank_section_version(uint32_t tag)
{
    return tag == BANK_GRID || tag == BANK_FACT ? 2 : 1;
}

_Static_assert(sizeof(struct bank_header) == 64, "layout of the bank header");
_Static_assert(sizeof(struct bank_section) == 32, "layout of a section entry");
_Static_assert(sizeof(struct bank_triangle) == 12, "layout of a triangle");
_Static_assert(sizeof(struct bank_factor) == 16, "layout of the factor header");
_Static_assert(sizeof(struct bank_context) == 8, "layout of a context");
_Static_assert(sizeof(struct bank_table) == 38, "layout of a table of symbols");
_Static_assert(sizeof(struct bank_grid) == 32, "layout of the grid header");
_Static_assert(sizeof(struct bank_contact) == 32, "layout of the contact record");
_Static_assert(sizeof(struct bank_friction) == 16, "layout of the friction record");
_Static_assert(sizeof(struct bank_branch) == 16, "layout of a branch");
_Static_assert(sizeof(struct bank_viscoelastic) == 16, "layout of the record before the branches");
_Static_assert(sizeof(struct bank_quasi_nonlinear) == 96, "layout of the curves");
_Static_assert(sizeof(struct bank_cubic) == 28, "layout of a cubic form");
_Static_assert(sizeof(struct bank_neo_hookean) == 16, "layout of the record before the cubic forms");
_Static_assert(sizeof(struct bank_sphere) == 32, "layout of a sphere");
_Static_assert(sizeof(struct bank_shape) == 560, "layout of the record before the seeds");
_Static_assert(sizeof(struct bank_axis) == 28, "layout of an axis");
_Static_assert(sizeof(struct bank_tool) == 368, "layout of an instrument");

#endif
