// Linear DELTA: least reach margin, rails and swing, det of the struts and of the parallelograms, 1/κ_F.
#include "peer.h"

enum { OUTPUTS = 5 };

// no limit of the swing: a sine that every angle is below
#define SWING_SINE 2.0

typedef struct {
    double anchor[3][3], rail[3][3], hinge[3][3], strut[3], travel[3], side[3];
} Machine;

static Machine read_machine(void) {
    Machine machine;
    double base[3], platform[3], azimuth[3], tilt[3];
    three("R", base), three("r", platform), three("l", machine.strut), three("rail", machine.travel);
    three("azimuth", azimuth), three("tilt", tilt), three("carriages", machine.side);
    for (int i = 0; i < 3; i++) {
        double c = cos(azimuth[i]), s = sin(azimuth[i]), st = sin(tilt[i]), radius = base[i] - platform[i];
        double anchor[3] = {radius * c, radius * s, 0.0}, rail[3] = {st * c, st * s, -cos(tilt[i])};
        double hinge[3] = {-s, c, 0.0};
        memcpy(machine.anchor[i], anchor, sizeof anchor);
        memcpy(machine.rail[i], rail, sizeof rail);
        memcpy(machine.hinge[i], hinge, sizeof hinge);
    }
    return machine;
}

// unit row, s_i · u_i, and the margins
typedef struct {
    double row[3], b, reach, limits;
} Limb;

INLINE Limb limb(const Machine *m, int i, double x, double y, double z) {
    Limb out;
    const double *u = m->rail[i];
    double l = m->strut[i], c[3], turned[3];
    double w[3] = {x - m->anchor[i][0], y - m->anchor[i][1], z - m->anchor[i][2]};
    cross(w, u, c);
    double across = square(c), h = sqrt(positive(l * l - across)), b = m->side[i] * h;
    cross(u, c, turned);
    for (int j = 0; j < 3; j++) out.row[j] = (turned[j] + b * u[j]) / l;
    out.b = b / l;
    out.reach = l - sqrt(across);
    double q = dot(w, u) - b, swing = l * SWING_SINE - fabs(dot(w, m->hinge[i]));
    out.limits = lesser(lesser(q, m->travel[i] - q), swing);
    return out;
}

INLINE void at(const Machine *m, int margins, int condition, double x, double y, double z, double *out) {
    Limb a = limb(m, 0, x, y, z), b = limb(m, 1, x, y, z), c = limb(m, 2, x, y, z);
    if (margins) {
        out[0] = lesser(lesser(a.reach, b.reach), c.reach);
        out[1] = lesser(lesser(a.limits, b.limits), c.limits);
        out[2] = determinant(a.row, b.row, c.row);
        out[3] = rotation_determinant(a.row, b.row, c.row, m->hinge);
    }
    if (condition) out[4] = conditioning(a.row, b.row, c.row, a.b, b.b, c.b);
}

#include "main.h"
