// The loop over poses, and a main that reads, repeats, times and writes. OUTPUTS: how many values a pose has.
#include <time.h>

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

INLINE void loop(int margins, int condition, Machine machine, long n,
                                                       const double *table, double *out) {
#pragma GCC ivdep
    for (long k = 0; k < n; k++) {
        double values[OUTPUTS];
        at(&machine, margins, condition, table[k], table[n + k], table[2 * n + k], values);
        if (margins)
            for (int j = 0; j < OUTPUTS - 1; j++) out[j * n + k] = values[j];
        if (condition) out[(OUTPUTS - 1) * n + k] = values[OUTPUTS - 1];
    }
}

__attribute__((noinline)) static void evaluate(char what, Machine machine, long n, const double *table,
                                               double *out) {
    if (what == 'm')
        loop(1, 0, machine, n, table, out);
    else if (what == 'c')
        loop(0, 1, machine, n, table, out);
    else
        loop(1, 1, machine, n, table, out);
}

// usage: PROGRAM margins|condition|all POSES REPEATS INPUT OUTPUT NAME=VALUE,VALUE,VALUE …
int main(int count, char **words) {
    if (count < 6) return 2;
    word_count = count, words_given = words;
    long n = atol(words[2]), repeats = atol(words[3]);
    double *table = malloc((3 + OUTPUTS) * n * sizeof(double));
    FILE *input = fopen(words[4], "rb");
    if (!table || !input || fread(table, sizeof(double), 3 * n, input) != (size_t)(3 * n)) return 1;
    double *out = table + 3 * n;
    Machine machine = read_machine();
    for (long k = 0; k < repeats; k++) {
        double began = now();
        evaluate(words[1][0], machine, n, table, out);
        printf("%.9f\n", now() - began);
    }
    FILE *output = fopen(words[5], "wb");
    if (!output || fwrite(out, sizeof(double), OUTPUTS * n, output) != (size_t)(OUTPUTS * n)) return 1;
    return fclose(output);
}
