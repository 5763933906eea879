// 3-CRR without limits but the fold: least reach margin, nothing else that limits, det of the axes, 1/κ_F.
#include "peer.h"

enum { OUTPUTS = 4 };

typedef struct {
    double first[3], second[3], offset[3][3], axis[3][3];
} Machine;

static Machine read_machine(void) {
    Machine machine;
    double azimuth[3], elevation[3], base[3][3], platform[3][3];
    three("f", machine.first), three("r", machine.second);
    three("azimuth", azimuth), three("elevation", elevation);
    three("ax", base[0]), three("ay", base[1]), three("az", base[2]);
    three("bx", platform[0]), three("by", platform[1]), three("bz", platform[2]);
    for (int i = 0; i < 3; i++) {
        double c = cos(elevation[i]), axis[3] = {cos(azimuth[i]) * c, sin(azimuth[i]) * c, sin(elevation[i])};
        memcpy(machine.axis[i], axis, sizeof axis);
        for (int j = 0; j < 3; j++) machine.offset[i][j] = platform[j][i] - base[j][i];
    }
    return machine;
}

// the lesser of the outer and the inner margin
INLINE double reach(const Machine *m, int i, double x, double y, double z) {
    double w[3] = {x + m->offset[i][0], y + m->offset[i][1], z + m->offset[i][2]}, across[3];
    cross(m->axis[i], w, across);
    double rho = sqrt(square(across)), f = m->first[i], r = m->second[i];
    return lesser(f + r - rho, rho - fabs(f - r));
}

INLINE void at(const Machine *m, int margins, int condition, double x, double y, double z, double *out) {
    if (margins) {
        out[0] = lesser(lesser(reach(m, 0, x, y, z), reach(m, 1, x, y, z)), reach(m, 2, x, y, z));
        out[1] = 1.0;
        out[2] = determinant(m->axis[0], m->axis[1], m->axis[2]);
    }
    if (condition) out[3] = conditioning(m->axis[0], m->axis[1], m->axis[2], 1.0, 1.0, 1.0);
}

#include "main.h"
