// 3-URU: least reach margin, side of the octant, det V, det W and det H of unit rows, 1/κ_F of the motors.
#include "peer.h"

enum { OUTPUTS = 6 };

typedef struct {
    double offset[3], proximal[3], distal[3], gear[3], octant[3], elbow[3];
} Machine;

static Machine read_machine(void) {
    Machine machine;
    double base[3];
    three("db", base), three("dp", machine.offset), three("f", machine.proximal), three("r", machine.distal);
    three("k", machine.gear), three("octant", machine.octant), three("elbows", machine.elbow);
    for (int i = 0; i < 3; i++) machine.offset[i] -= base[i];
    return machine;
}

// rows of V and W along e_i, e_j, e_k and the entry of b; ``unit``: W's row and b over the row's length
typedef struct {
    double v[3], w[3], b, outer, inner, hj;
} Limb;

INLINE double cosine(double p, double q) {
    double size = p * p + q * q;
    return p / sqrt(size > 1e-300 ? size : 1e-300);
}

INLINE Limb limb(const Machine *m, int i, int unit, double p, double pj, double pk) {
    Limb out;
    double f = m->proximal[i], r = m->distal[i], sum = f + r, difference = f - r;
    double alpha = p + m->offset[i];
    double beta_squared = pj * pj + pk * pk, beta = sqrt(beta_squared);
    double rho_squared = alpha * alpha + beta_squared, rho = sqrt(rho_squared), inverse = 1.0 / rho_squared;
    double share = 0.5 + 0.5 * (r * r - f * f) * inverse;
    double bend = 0.5 * m->elbow[i] *
                  sqrt(positive(sum * sum * inverse - 1.0) * positive(1.0 - difference * difference * inverse));
    double a = (alpha * share + beta * bend) / r, c = (beta * share - alpha * bend) / r;
    double hj = cosine(pj, pk), hk = cosine(pk, pj);
    double lever = -m->gear[i] * (rho_squared * bend) / r;
    double toward = unit ? cosine(beta, lever) : 1.0, across = unit ? cosine(lever, beta) : lever / beta;
    out.b = lever * toward, out.hj = hj;
    out.outer = sum - rho;
    out.inner = rho - fabs(difference);
    out.v[0] = a, out.v[1] = c * hj, out.v[2] = c * hk;
    out.w[0] = toward * a, out.w[1] = toward * (c * hj) - across * hk, out.w[2] = toward * (c * hk) + across * hj;
    return out;
}

INLINE double side(const Machine *m, int i, double coordinate) {
    double sign = m->octant[i];
    return sign * coordinate + (1.0 - sign * sign);
}

INLINE void at(const Machine *m, int margins, int condition, double x, double y, double z, double *out) {
    Limb a = limb(m, 0, margins, x, y, z), b = limb(m, 1, margins, y, z, x), c = limb(m, 2, margins, z, x, y);
    double w2[3] = {b.w[2], b.w[0], b.w[1]}, w3[3] = {c.w[1], c.w[2], c.w[0]};
    if (margins) {
        double v2[3] = {b.v[2], b.v[0], b.v[1]}, v3[3] = {c.v[1], c.v[2], c.v[0]};
        out[0] = lesser(lesser(lesser(a.outer, a.inner), lesser(b.outer, b.inner)), lesser(c.outer, c.inner));
        out[1] = lesser(lesser(side(m, 0, x), side(m, 1, y)), side(m, 2, z));
        out[2] = determinant(a.v, v2, v3);
        out[3] = determinant(a.w, w2, w3);
        out[4] = 2.0 * a.hj * b.hj * c.hj;
    }
    if (condition) out[5] = conditioning(a.w, w2, w3, a.b, b.b, c.b);
}

#include "main.h"
