// DELTA: least reach margin, arm and swing, det of the lower arms and of the parallelograms, 1/κ_F.
#include "peer.h"

enum { OUTPUTS = 5 };

// no limits: a cosine that every angle is above, a sine that every angle is below
#define RANGE_BOUND -2.0
#define SWING_SINE 2.0

typedef struct {
    double offset[3], proximal[3], distal[3], outward[3][3], hinge[3][3], elbow[3];
} Machine;

static Machine read_machine(void) {
    Machine machine;
    double base[3], platform[3], azimuth[3];
    three("w", base), three("u", platform), three("L", machine.proximal), three("l", machine.distal);
    three("azimuth", azimuth), three("elbows", machine.elbow);
    for (int i = 0; i < 3; i++) {
        double c = cos(azimuth[i]), s = sin(azimuth[i]);
        double outward[3] = {c, s, 0.0}, hinge[3] = {-s, c, 0.0};
        machine.offset[i] = base[i] - platform[i];
        memcpy(machine.outward[i], outward, sizeof outward);
        memcpy(machine.hinge[i], hinge, sizeof hinge);
    }
    return machine;
}

// unit row, b, and the margins
typedef struct {
    double row[3], b, outer, inner, limits;
} Limb;

INLINE Limb limb(const Machine *m, int i, double x, double y, double z) {
    Limb out;
    const double *e = m->outward[i], *t = m->hinge[i];
    double upper = m->proximal[i], lower = m->distal[i];
    double alpha = x * e[0] + y * e[1] - m->offset[i], beta = -z, aside = x * t[0] + y * t[1];
    double across = aside * aside, whole = lower * lower, left = whole - across;
    // the lower arm as it is seen along the motor's axis
    double seen_squared = left > 1e-12 * whole ? left : 1e-12 * whole, seen = sqrt(seen_squared);
    double rho_squared = alpha * alpha + beta * beta, rho = sqrt(rho_squared), inverse = 1.0 / rho_squared;
    double sum = upper + seen, difference = upper - seen;
    double share = 0.5 + 0.5 * (seen_squared - upper * upper) * inverse;
    double bend = -0.5 * m->elbow[i] *
                  sqrt(positive(sum * sum * inverse - 1.0) * positive(1.0 - difference * difference * inverse));
    // times the lower arm's length in place of the seen one
    double a = alpha * share + beta * bend, c = beta * share - alpha * bend;
    double along = a / lower, swung = aside / lower;
    out.row[0] = along * e[0] + swung * t[0], out.row[1] = along * e[1] + swung * t[1], out.row[2] = -c / lower;
    out.b = -(rho_squared * bend) / lower;
    double far = rho + upper, near = rho - upper;
    out.outer = lower - sqrt(near * near + across);
    out.inner = sqrt(far * far + across) - lower;
    out.limits = lesser(alpha - a - upper * RANGE_BOUND, lower * SWING_SINE - fabs(aside));
    return out;
}

INLINE void at(const Machine *m, int margins, int condition, double x, double y, double z, double *out) {
    Limb a = limb(m, 0, x, y, z), b = limb(m, 1, x, y, z), c = limb(m, 2, x, y, z);
    if (margins) {
        out[0] = lesser(lesser(lesser(a.outer, a.inner), lesser(b.outer, b.inner)), lesser(c.outer, c.inner));
        out[1] = lesser(lesser(a.limits, b.limits), c.limits);
        out[2] = determinant(a.row, b.row, c.row);
        out[3] = rotation_determinant(a.row, b.row, c.row, m->hinge);
    }
    if (condition) out[4] = conditioning(a.row, b.row, c.row, a.b, b.b, c.b);
}

#include "main.h"
