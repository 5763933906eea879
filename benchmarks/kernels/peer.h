// What the C programs of this folder share: vectors, determinants, 1/κ_F, and the words of the command line.
// Each of them declares Machine, read_machine and at, with the formulas of src/tpm_design/mechanisms/, and
// includes main.h at its end.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// a call that is left over keeps the loop from being vectorised
#define INLINE static inline __attribute__((always_inline))

INLINE double positive(double x) { return x > 0.0 ? x : 0.0; }
INLINE double lesser(double a, double b) { return a < b ? a : b; }
INLINE double dot(const double *u, const double *v) { return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]; }
INLINE double square(const double *u) { return dot(u, u); }

INLINE void cross(const double *u, const double *v, double *out) {
    out[0] = u[1] * v[2] - u[2] * v[1];
    out[1] = u[2] * v[0] - u[0] * v[2];
    out[2] = u[0] * v[1] - u[1] * v[0];
}

INLINE double determinant(const double *a, const double *b, const double *c) {
    double product[3];
    cross(b, c, product);
    return dot(a, product);
}

// 1/κ_F of A ẋ = diag(b) q̇ from the rows of A
INLINE double conditioning(const double *r1, const double *r2, const double *r3, double b1, double b2,
                                  double b3) {
    double u[3], v[3], w[3];
    cross(r2, r3, u), cross(r3, r1, v), cross(r1, r2, w);
    double c1 = b2 * b3, c2 = b3 * b1, c3 = b1 * b2;
    double forward = b1 * b1 * square(u) + b2 * b2 * square(v) + b3 * b3 * square(w);
    double backward = c1 * c1 * square(r1) + c2 * c2 * square(r2) + c3 * c3 * square(r3);
    double product = forward * backward;
    return product > 0.0 ? 3.0 * fabs(dot(r1, u) * b1 * c1) / sqrt(product) : 0.0;
}

INLINE void unit_normal(const double *rod, const double *bar, double *out) {
    cross(rod, bar, out);
    double scale = 1.0 / sqrt(square(out));
    for (int j = 0; j < 3; j++) out[j] *= scale;
}

// det of the unit normals of three parallelograms with these rods and short bars
INLINE double rotation_determinant(const double *r1, const double *r2, const double *r3,
                                          const double (*bars)[3]) {
    double n1[3], n2[3], n3[3];
    unit_normal(r1, bars[0], n1), unit_normal(r2, bars[1], n2), unit_normal(r3, bars[2], n3);
    return determinant(n1, n2, n3);
}

static int word_count;
static char **words_given;

// three values of name=first,second,third on the command line
static void three(const char *name, double *out) {
    size_t length = strlen(name);
    for (int k = 0; k < word_count; k++)
        if (!strncmp(words_given[k], name, length) && words_given[k][length] == '=' &&
            sscanf(words_given[k] + length + 1, "%lf,%lf,%lf", out, out + 1, out + 2) == 3)
            return;
    fprintf(stderr, "%s is missing\n", name);
    exit(2);
}
