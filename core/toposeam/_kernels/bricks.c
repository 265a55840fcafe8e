/* Heat on a grid that is cut into bricks, and likenesses of patches: what takes most of the time of surfaces and
   loops. */
#include "kernels.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static inline float within(float value, float low, float high) {
    value = value < low ? low : value;
    return value > high ? high : value;
}

/* One axis of a brick of `outer` × n × `inner` voxels: fill the conductors to the next voxels, and add what they
   bring to the surplus, which begins with the first axis. `beyond` is the next brick, `entering` what the one before
   lets in. Most is done on all voxels in a row; what lies at the ends of the axis is set right after that. */
static void along_axis(
    int outer, int n, int inner, int begins, const float *restrict own, const float *restrict beyond,
    float *restrict filled, const float *restrict cost, float *restrict leaving, const float *restrict entering,
    float *restrict flow, float *restrict arrives, float *restrict surplus) {
    const int layer = n * inner, size = outer * layer;
    for (int i = 0; i < size - inner; i++) flow[i] = own[i + inner] - own[i];
    for (int at = 0; at < size; at += layer)
        for (int i = at; i < at + inner; i++) flow[i + layer - inner] = beyond[i] - own[i + layer - inner];
    for (int i = 0; i < size; i++) {
        const float share = within(filled[i] + flow[i], -1, 1);
        filled[i] = share;
        flow[i] = share * cost[i];
    }
    memcpy(arrives + inner, flow, (size - inner) * sizeof *flow);
    for (int o = 0; o < outer; o++)
        for (int i = 0; i < inner; i++) {
            leaving[o * inner + i] = flow[(o + 1) * layer - inner + i];
            arrives[o * layer + i] = entering[o * inner + i];
        }
    if (begins)
        for (int i = 0; i < size; i++) surplus[i] = arrives[i] - flow[i];
    else
        for (int i = 0; i < size; i++) surplus[i] = surplus[i] - flow[i] + arrives[i];
}

/* Let the heat of `count` bricks of a × b × c voxels move on by one step. Bricks stand in the order of their places:
   those before one have let their heat leave, those behind it have their old temperatures. Returns 0, or -1 where
   there is no memory. */
EXPORTED int sweep_bricks(
    int64_t count, int32_t a, int32_t b, int32_t c, float hot, float *temperature, float *ahead, const float *rate,
    float *filled0, float *filled1, float *filled2, const float *cost0, const float *cost1, const float *cost2,
    const int64_t *lower0, const int64_t *lower1, const int64_t *lower2, const int64_t *upper0, const int64_t *upper1,
    const int64_t *upper2, float *leaving0, float *leaving1, float *leaving2) {
    const int64_t size = (int64_t)a * b * c;
    float *flow = malloc(3 * (size_t)size * sizeof *flow), *surplus = flow + size, *arrives = surplus + size;
    if (!flow) return -1;
    for (int64_t k = 0; k < count; k++) {
        const int64_t at = k * size, side0 = b * c, side1 = a * c, side2 = a * b;
        float *restrict own = ahead + at, *restrict now = temperature + at;
        along_axis(
            1, a, b * c, 1, own, ahead + upper0[k] * size, filled0 + at, cost0 + at, leaving0 + k * side0,
            leaving0 + lower0[k] * side0, flow, arrives, surplus);
        along_axis(
            a, b, c, 0, own, ahead + upper1[k] * size, filled1 + at, cost1 + at, leaving1 + k * side1,
            leaving1 + lower1[k] * side1, flow, arrives, surplus);
        along_axis(
            a * b, c, 1, 0, own, ahead + upper2[k] * size, filled2 + at, cost2 + at, leaving2 + k * side2,
            leaving2 + lower2[k] * side2, flow, arrives, surplus);
        const float *restrict own_rate = rate + at;
        for (int64_t i = 0; i < size; i++) {
            const float next = within(now[i] - surplus[i] * own_rate[i], 0, hot);
            own[i] = next - now[i] + next;
            now[i] = next;
        }
    }
    free(flow);
    return 0;
}

/* For each of `places` patches of two successive frames, the least mean square distance, over some moments of the clip
   and shifts of up to `reach` px, from two successive frames there. Patches are squares of 2 `half` + 1 px; beyond the
   border stands the nearest pixel. moments[first[p]] … moments[first[p + 1] - 1] belong to place p. Returns 0, or -1
   where there is no memory. */
EXPORTED int nearest_patches(
    int32_t places, int32_t height, int32_t width, int32_t half, int32_t reach, const float *frames,
    const int32_t *place, const float *clip, const int32_t *first, const int32_t *moments, float *least) {
    const int wide = width + 2 * half, n = 2 * half + 1;
    const int64_t size = (int64_t)height * width;
    float *squares = malloc(((size_t)height * wide + wide) * sizeof *squares);
    if (!squares) return -1;
    float *sums = squares + (int64_t)height * wide;
    for (int p = 0; p < places; p++) {
        const float *one = frames + place[p] * size, *other = one + size;
        float *best = least + p * size;
        for (int64_t i = 0; i < size; i++) best[i] = INFINITY;
        for (int m = first[p]; m < first[p + 1]; m++) {
            const float *first_there = clip + moments[m] * size;
            for (int down = -reach; down <= reach; down++)
                for (int right = -reach; right <= reach; right++) {
                    const int begin = right < 0 ? -right : 0, end = right > 0 ? width - right : width;
                    for (int y = 0; y < height; y++) {
                        int z = y + down;
                        z = z < 0 ? 0 : z >= height ? height - 1 : z;
                        const float *here = one + (int64_t)y * width, *then = other + (int64_t)y * width;
                        const float *there = first_there + (int64_t)z * width, *next = there + size;
                        float *row = squares + (int64_t)y * wide + half;
                        for (int x = 0; x < begin && x < width; x++) {
                            const float u = there[0] - here[x], v = next[0] - then[x];
                            row[x] = u * u + v * v;
                        }
                        for (int x = begin; x < end; x++) {
                            const float u = there[x + right] - here[x], v = next[x + right] - then[x];
                            row[x] = u * u + v * v;
                        }
                        for (int x = end < begin ? begin : end; x < width; x++) {
                            const float u = there[width - 1] - here[x], v = next[width - 1] - then[x];
                            row[x] = u * u + v * v;
                        }
                        for (int x = 0; x < half; x++) {
                            row[x - half] = row[0];
                            row[width + x] = row[width - 1];
                        }
                    }
                    for (int y = 0; y < height; y++) {
                        memset(sums, 0, wide * sizeof *sums);
                        for (int k = -half; k <= half; k++) {
                            const int z = y + k < 0 ? 0 : y + k >= height ? height - 1 : y + k;
                            const float *row = squares + (int64_t)z * wide;
                            for (int x = 0; x < wide; x++) sums[x] += row[x];
                        }
                        float *nearest = best + (int64_t)y * width;
                        for (int x = 0; x < width; x++) {
                            float sum = sums[x];
                            for (int k = 1; k < n; k++) sum += sums[x + k];
                            nearest[x] = sum < nearest[x] ? sum : nearest[x];
                        }
                    }
                }
        }
        for (int64_t i = 0; i < size; i++) best[i] /= n * n;
    }
    free(squares);
    return 0;
}
