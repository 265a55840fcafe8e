/* Blur pictures by a symmetric filter, down their columns and then along their rows. */
#include "kernels.h"

#include <stdlib.h>

/* The index of what lies at `at` where a line goes on mirrored, its ends repeated. */
static int64_t mirrored(int64_t at, int64_t size) {
    at %= 2 * size;
    if (at < 0) at += 2 * size;
    return at < size ? at : 2 * size - 1 - at;
}

/* Filter `count` values: lines[radius] are the values, and those before and behind lie beside them. The farthest are
   added first. */
FOR_EACH_PROCESSOR static void filtered(int64_t count, int32_t radius, const double *weights,
                                        const double *const *lines, double *restrict sum) {
    const double *middle = lines[radius];
    for (int64_t x = 0; x < count; x++) sum[x] = middle[x] * weights[0];
    int32_t far = radius;
    for (; far > 1; far -= 2) {
        const double *a = lines[radius - far], *b = lines[radius + far], outer = weights[far];
        const double *c = lines[radius - far + 1], *d = lines[radius + far - 1], inner = weights[far - 1];
        for (int64_t x = 0; x < count; x++) sum[x] = (sum[x] + (a[x] + b[x]) * outer) + (c[x] + d[x]) * inner;
    }
    if (far) {
        const double *a = lines[radius - 1], *b = lines[radius + 1], inner = weights[1];
        for (int64_t x = 0; x < count; x++) sum[x] += (a[x] + b[x]) * inner;
    }
}

/* Blur `count` pictures (rows, columns) by the filter whose half is `weights` (radius + 1,), the middle first.
   Beyond its borders a picture goes on mirrored. Returns 0, or -1 without memory. */
EXPORTED int32_t blurred(int32_t count, int32_t rows, int32_t columns, const float *pictures, int32_t radius,
                         const double *weights, float *target) {
    const int64_t size = 2 * (int64_t)radius + 1;
    /* the rows round one, that one blurred down its columns, and sums */
    double *kept = malloc((size * columns + columns + 2 * (int64_t)radius + columns) * sizeof *kept);
    double *line = kept + size * columns, *sum = line + columns + 2 * (int64_t)radius;
    const double **lines = malloc(size * sizeof *lines);
    const int32_t failed = !kept || !lines;
    for (int64_t row = 0; !failed && columns && row < (int64_t)count * rows; row++) {
        const int64_t within = row % rows;
        const float *picture = pictures + (row - within) * columns;
        for (int64_t next = within ? within + radius : -radius; next <= within + radius; next++) {
            const float *source = picture + mirrored(next, rows) * columns;
            double *own = kept + (next + radius) % size * columns;
            for (int32_t x = 0; x < columns; x++) own[x] = source[x];
        }
        for (int64_t k = 0; k < size; k++) lines[k] = kept + (within + k) % size * columns;
        filtered(columns, radius, weights, lines, sum);
        for (int32_t x = 0; x < columns; x++) line[radius + x] = (float)sum[x];
        for (int32_t k = 0; k < radius; k++) {
            line[k] = line[radius + mirrored(k - (int64_t)radius, columns)];
            line[radius + columns + k] = line[radius + mirrored(columns + (int64_t)k, columns)];
        }
        for (int64_t k = 0; k < size; k++) lines[k] = line + k;
        filtered(columns, radius, weights, lines, sum);
        for (int32_t x = 0; x < columns; x++) target[row * columns + x] = (float)sum[x];
    }
    free(kept);
    free(lines);
    return -failed;
}
