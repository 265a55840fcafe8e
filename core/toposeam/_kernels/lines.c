/* Straight pieces of edges that lie on one line become one. */
#include "kernels.h"

#include <math.h>
#include <stdlib.h>

/* Join pieces (count, 4), x and y of both ends, the longest first, and write the lines, as many or fewer. `bounds` are
   the largest distance from a line; its largest angle and how much more that is ÷ the length, rad; and the largest gap,
   absolute and ÷ the length. Returns the number of lines, or -1 without memory. */
EXPORTED int32_t join_pieces(int32_t count, const double *pieces, const double *bounds, double *lines) {
    const double aside = bounds[0], apart = bounds[1], apart_short = bounds[2];
    uint8_t *free_ones = malloc(count + 1), *near = malloc(count + 1);
    int32_t found = free_ones && near ? 0 : -1;
    for (int32_t i = 0; found >= 0 && i < count; i++) free_ones[i] = 1;
    for (int32_t first = 0; found >= 0 && first < count; first++) {
        if (!free_ones[first]) continue;
        free_ones[first] = 0;
        double *line = lines + 4 * found++;
        for (int32_t k = 0; k < 4; k++) line[k] = pieces[4 * first + k];
        for (;;) {
            double x = line[2] - line[0], y = line[3] - line[1];
            const double length = hypot(x, y), gap = fmax(bounds[3], bounds[4] * length);
            const double least = cos(apart + apart_short / length);
            x /= length;
            y /= length;
            double low = 0, high = length, sum_x = line[0] + line[2], sum_y = line[1] + line[3];
            int32_t joined = 0;
            for (int32_t i = first + 1; i < count; i++) {
                near[i] = 0;
                if (!free_ones[i]) continue;
                const double *own = pieces + 4 * i;
                const double ax = own[0] - line[0], ay = own[1] - line[1], bx = own[2] - line[0], by = own[3] - line[1];
                if (!(fmax(fabs(ay * x - ax * y), fabs(by * x - bx * y)) < aside)) continue;
                const double dx = own[2] - own[0], dy = own[3] - own[1], long_one = fmax(hypot(dx, dy), 1e-9);
                if (!(fabs(dx / long_one * x + dy / long_one * y) > least)) continue;
                const double a = ax * x + ay * y, b = bx * x + by * y;
                if (!(fmax(fmin(a, b) - length, -fmax(a, b)) < gap)) continue;
                near[i] = 1;
                free_ones[i] = 0;
                joined++;
                low = fmin(low, fmin(a, b));
                high = fmax(high, fmax(a, b));
                sum_x += own[0] + own[2];
                sum_y += own[1] + own[3];
            }
            if (!joined) break;
            const double middle_x = sum_x / (2 * joined + 2), middle_y = sum_y / (2 * joined + 2);
            double xx = 0, xy = 0, yy = 0;
            for (int32_t i = first; i < count; i++) {
                if (i > first && !near[i]) continue;
                const double *own = i == first ? line : pieces + 4 * i;
                for (int32_t k = 0; k < 4; k += 2) {
                    const double dx = own[k] - middle_x, dy = own[k + 1] - middle_y;
                    xx += dx * dx;
                    xy += dx * dy;
                    yy += dy * dy;
                }
            }
            const double turn = 0.5 * atan2(2 * xy, xx - yy);
            double along_x = cos(turn), along_y = sin(turn);
            const double sign = along_x * x + along_y * y;
            if (sign < 0) along_x = -along_x, along_y = -along_y;
            const double offset = (line[0] - middle_x) * along_x + (line[1] - middle_y) * along_y;
            line[0] = middle_x + (offset + low) * along_x;
            line[1] = middle_y + (offset + low) * along_y;
            line[2] = middle_x + (offset + high) * along_x;
            line[3] = middle_y + (offset + high) * along_y;
        }
    }
    free(free_ones);
    free(near);
    return found;
}
