// Margins of a 3-URU at many poses: the formulas of src/tpm_design/mechanisms/uru.py, loops fused.
// Reads parameters and poses from a file, prints the seconds of each repetition, writes the results.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

typedef struct {
    double base[3], platform[3], proximal[3], distal[3], gear[3], octant[3], elbow[3];
} Machine;

typedef struct {
    double v[3], w[3], gamma, gain, outer, inner;
} Limb;

static inline double positive(double x) { return x > 0.0 ? x : 0.0; }
static inline double lesser(double a, double b) { return a < b ? a : b; }
static inline double square(const double *u) { return u[0] * u[0] + u[1] * u[1] + u[2] * u[2]; }

static inline double cosine(double p, double q) {
    double size = p * p + q * q;
    return p / sqrt(size > 1e-300 ? size : 1e-300);
}

static inline double determinant(const double *a, const double *b, const double *c) {
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) +
           a[2] * (b[0] * c[1] - b[1] * c[0]);
}

// row of V (unit) and of W along e_i, e_j, e_k; W's unit where unit is 1, as in the velocity map where 0
static inline Limb limb(const Machine *m, int i, int unit, double p, double pj, double pk) {
    Limb out;
    double f = m->proximal[i], r = m->distal[i], sum = f + r, difference = f - r;
    double alpha = p + (m->platform[i] - m->base[i]);
    double beta_squared = pj * pj + pk * pk, beta = sqrt(beta_squared);
    double rho_squared = alpha * alpha + beta_squared, rho = sqrt(rho_squared), inverse = 1.0 / rho_squared;
    double share = 0.5 + 0.5 * (r * r - f * f) * inverse;
    double bend = 0.5 * m->elbow[i] *
                  sqrt(positive(sum * sum * inverse - 1.0) * positive(1.0 - difference * difference * inverse));
    double a = (alpha * share + beta * bend) / r, c = (beta * share - alpha * bend) / r;
    double hj = cosine(pj, pk), hk = cosine(pk, pj);
    out.gamma = -(rho_squared * bend) / r;
    double lever = m->gear[i] * out.gamma;
    double toward = unit ? cosine(beta, lever) : 1.0, across = unit ? cosine(lever, beta) : lever / beta;
    out.gain = lever;
    out.outer = sum - rho;
    out.inner = rho - fabs(difference);
    out.v[0] = a, out.v[1] = c * hj, out.v[2] = c * hk;
    out.w[0] = toward * a, out.w[1] = toward * (c * hj) - across * hk, out.w[2] = toward * (c * hk) + across * hj;
    return out;
}

static inline double side(double sign, double coordinate) { return sign * coordinate + (1.0 - sign * sign); }

__attribute__((noinline)) void margins(const Machine *machine, long n, const double *restrict x,
                                       const double *restrict y, const double *restrict z,
                                       double *restrict legs, double *restrict sides, double *restrict translation,
                                       double *restrict actuation, double *restrict rotation) {
    Machine m = *machine;
    for (long k = 0; k < n; k++) {
        Limb a = limb(&m, 0, 1, x[k], y[k], z[k]);
        Limb b = limb(&m, 1, 1, y[k], z[k], x[k]);
        Limb c = limb(&m, 2, 1, z[k], x[k], y[k]);
        legs[k] = lesser(lesser(lesser(a.outer, a.inner), lesser(b.outer, b.inner)), lesser(c.outer, c.inner));
        sides[k] = lesser(lesser(side(m.octant[0], x[k]), side(m.octant[1], y[k])), side(m.octant[2], z[k]));
        double v2[3] = {b.v[2], b.v[0], b.v[1]}, v3[3] = {c.v[1], c.v[2], c.v[0]};
        double w2[3] = {b.w[2], b.w[0], b.w[1]}, w3[3] = {c.w[1], c.w[2], c.w[0]};
        translation[k] = determinant(a.v, v2, v3);
        actuation[k] = determinant(a.w, w2, w3);
        rotation[k] = 2.0 * cosine(x[k], y[k]) * cosine(y[k], z[k]) * cosine(z[k], x[k]);
    }
}

// 1/κ_F driven by the motors
__attribute__((noinline)) void conditioning(const Machine *machine, long n, const double *restrict x,
                                            const double *restrict y, const double *restrict z,
                                            double *restrict out) {
    Machine m = *machine;
    for (long k = 0; k < n; k++) {
        Limb a = limb(&m, 0, 0, x[k], y[k], z[k]);
        Limb b = limb(&m, 1, 0, y[k], z[k], x[k]);
        Limb c = limb(&m, 2, 0, z[k], x[k], y[k]);
        double *r1 = a.w, r2[3] = {b.w[2], b.w[0], b.w[1]}, r3[3] = {c.w[1], c.w[2], c.w[0]};
        double u[3] = {r2[1] * r3[2] - r2[2] * r3[1], r2[2] * r3[0] - r2[0] * r3[2], r2[0] * r3[1] - r2[1] * r3[0]};
        double v[3] = {r3[1] * r1[2] - r3[2] * r1[1], r3[2] * r1[0] - r3[0] * r1[2], r3[0] * r1[1] - r3[1] * r1[0]};
        double w[3] = {r1[1] * r2[2] - r1[2] * r2[1], r1[2] * r2[0] - r1[0] * r2[2], r1[0] * r2[1] - r1[1] * r2[0]};
        double det = r1[0] * u[0] + r1[1] * u[1] + r1[2] * u[2];
        double b1 = a.gain, b2 = b.gain, b3 = c.gain, c1 = b2 * b3, c2 = b3 * b1, c3 = b1 * b2;
        double forward = b1 * b1 * square(u) + b2 * b2 * square(v) + b3 * b3 * square(w);
        double backward = c1 * c1 * square(r1) + c2 * c2 * square(r2) + c3 * c3 * square(r3);
        double product = forward * backward;
        out[k] = product > 0.0 ? 3.0 * fabs(det * b1 * c1) / sqrt(product) : 0.0;
    }
}

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

// usage: point_kernel margins|conditioning POSES REPEATS INPUT OUTPUT
int main(int count, char **words) {
    if (count != 6) return 2;
    long n = atol(words[2]), repeats = atol(words[3]);
    double *table = malloc(8 * n * sizeof(double));
    Machine machine;
    FILE *input = fopen(words[4], "rb");
    if (!table || !input || fread(&machine, sizeof machine, 1, input) != 1 ||
        fread(table, sizeof(double), 3 * n, input) != (size_t)(3 * n))
        return 1;
    const double *x = table, *y = table + n, *z = table + 2 * n;
    double *out = table + 3 * n;
    for (long k = 0; k < repeats; k++) {
        double began = now();
        if (words[1][0] == 'm')
            margins(&machine, n, x, y, z, out, out + n, out + 2 * n, out + 3 * n, out + 4 * n);
        else
            conditioning(&machine, n, x, y, z, out);
        printf("%.9f\n", now() - began);
    }
    FILE *output = fopen(words[5], "wb");
    long rows = words[1][0] == 'm' ? 5 : 1;
    if (!output || fwrite(out, sizeof(double), rows * n, output) != (size_t)(rows * n)) return 1;
    return fclose(output);
}
