// Orthoglide without limits of the stroke: least reach margin, swing, det of the struts, 1/κ_F.
#include "peer.h"

enum { OUTPUTS = 4 };

// no limit of the swing: a cosine that every angle is above
#define SWING_COSINE -2.0

typedef struct {
    double strut[3], side[3];
} Machine;

static Machine read_machine(void) {
    Machine machine;
    three("L", machine.strut), three("carriages", machine.side);
    return machine;
}

// unit row along e_i, e_j, e_k: the first is s_i · e_i
typedef struct {
    double row[3], reach, swing;
} Limb;

INLINE Limb limb(const Machine *m, int i, double pj, double pk) {
    Limb out;
    double l = m->strut[i], across = pj * pj + pk * pk, h = sqrt(positive(l * l - across));
    out.row[0] = -m->side[i] * h / l, out.row[1] = pj / l, out.row[2] = pk / l;
    out.reach = l - sqrt(across);
    out.swing = h - l * SWING_COSINE;
    return out;
}

INLINE void at(const Machine *m, int margins, int condition, double x, double y, double z, double *out) {
    Limb a = limb(m, 0, y, z), b = limb(m, 1, z, x), c = limb(m, 2, x, y);
    double row2[3] = {b.row[2], b.row[0], b.row[1]}, row3[3] = {c.row[1], c.row[2], c.row[0]};
    if (margins) {
        out[0] = lesser(lesser(a.reach, b.reach), c.reach);
        out[1] = lesser(lesser(a.swing, b.swing), c.swing);
        out[2] = determinant(a.row, row2, row3);
    }
    if (condition) out[3] = conditioning(a.row, row2, row3, a.row[0], b.row[0], c.row[0]);
}

#include "main.h"
