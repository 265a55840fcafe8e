/* Pictures at other places: coordinates between knots, and values between pixels by splines, as SciPy, and by
   Catmull-Rom's polynomials, as libvips computes them. */
#include "kernels.h"

#include <math.h>
#include <string.h>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

/* Values farther from the end of a line than this many pixels do not change its first coefficient. */
enum { REACH = 96 };

/* Points (rows, columns, 2) between knots (down, across, 2) that lie `step` px apart, the last at the edge; first
   along columns, then along rows, linearly. */
EXPORTED void between_knots(
    int32_t rows, int32_t columns, int32_t step, int32_t across, const double *knots, double *points) {
    for (int32_t y = 0; y < rows; y++) {
        const int32_t from = y / step;
        const int32_t high = (from + 1) * step < rows - 1 ? step : rows - 1 - from * step;
        const double *upper = knots + 2 * (int64_t)across * from, *lower = upper + 2 * across;
        const double along = y - from * step, share = 1.0 / (high > 1 ? high : 1);
        double left[2], right[2] = {0, 0};
        for (int32_t knot = 0; knot < across; knot++) {
            for (int c = 0; c < 2; c++) {
                left[c] = right[c];
                right[c] = (lower[2 * knot + c] - upper[2 * knot + c]) * share * along + upper[2 * knot + c];
            }
            if (!knot) continue;
            const int32_t begin = (knot - 1) * step;
            const int32_t wide = begin + step < columns - 1 ? step : columns - 1 - begin;
            const int32_t count = columns - begin < step ? columns - begin : step;
            const double part = 1.0 / (wide > 1 ? wide : 1);
            const double dx = (right[0] - left[0]) * part, dy = (right[1] - left[1]) * part;
            for (int32_t x = 0; x < count; x++) {
                *points++ = dx * x + left[0];
                *points++ = dy * x + left[1];
            }
        }
    }
}

/* Turn lines of `count` values into coefficients of the cubic spline through them, mirrored at its ends; the values of a
   line lie `stride` apart, and `beside` lines side by side. */
static void spline_filter(double *values, int32_t count, int64_t stride, int64_t beside) {
    if (count < 2) return;
    const double pole = -0.267949192431122706, gain = (1.0 - pole) * (1.0 - 1.0 / pole), far = pow(pole, count - 1);
    double *last = values + (count - 1) * stride, power = pole;
    for (int32_t i = 0; i < count; i++)
        for (int64_t k = 0; k < beside; k++) values[i * stride + k] *= gain;
    for (int64_t k = 0; k < beside; k++) values[k] = values[k] + far * last[k];
    for (int32_t i = 1; i < count - 1 && i < REACH; i++, power *= pole) {
        const double *left = values + i * stride, *right = last - i * stride;
        for (int64_t k = 0; k < beside; k++) values[k] += power * (left[k] + far * right[k]);
    }
    for (int64_t k = 0; k < beside; k++) values[k] /= 1 - far * far;
    for (int32_t i = 1; i < count; i++) {
        double *own = values + i * stride;
        for (int64_t k = 0; k < beside; k++) own[k] += pole * own[k - stride];
    }
    for (int64_t k = 0; k < beside; k++)
        last[k] = (pole * last[k - stride] + last[k]) * pole / (pole * pole - 1);
    for (int32_t i = count - 2; i >= 0; i--) {
        double *own = values + i * stride;
        for (int64_t k = 0; k < beside; k++) own[k] = pole * (own[k + stride] - own[k]);
    }
}

/* The weights of the four coefficients of a cubic spline round a place, and where they lie: beyond the ends as in a
   mirror whose middle is the last pixel. */
static inline void spline_weights(double place, int32_t size, double *weights, int64_t *at, int64_t stride) {
    place = size == 1 ? 0.0 : fabs(place);
    const int32_t first = (int32_t)place;
    const double y = place - first, z = 1.0 - y;
    weights[0] = z * z * z / 6.0;
    weights[1] = (y * y * (y - 2.0) * 3.0 + 4.0) / 6.0;
    weights[2] = (z * z * (z - 2.0) * 3.0 + 4.0) / 6.0;
    weights[3] = 1.0 - weights[0] - weights[1] - weights[2];
    for (int32_t k = 0; k < 4; k++) {
        int32_t i = first - 1 + k;
        while (i < 0 || i >= size) i = size == 1 ? 0 : i < 0 ? -i : 2 * (size - 1) - i;
        at[k] = i * stride;
    }
}

/* Values of up to four channels side by side, so that the processor need not wait for one sum. */
static inline void spline_sum(
    int32_t channels, const double *own, const int64_t *rows, const int64_t *columns, const double *down,
    const double *across, float *values) {
    double sum[4] = {0, 0, 0, 0};
    for (int32_t r = 0; r < 4; r++)
        for (int32_t k = 0; k < 4; k++)
            for (int32_t c = 0; c < channels; c++) sum[c] += own[rows[r] + columns[k] + c] * down[r] * across[k];
    for (int32_t c = 0; c < channels; c++) values[c] = (float)sum[c];
}

/* Values (count, channels) of the cubic spline through an image (height, width, channels), at points (count, 2) x and y
   on it; `coefficients` is room for those of the spline. */
EXPORTED void spline_values(
    int32_t height, int32_t width, int32_t channels, const float *image, double *coefficients, int64_t count,
    const double *points, float *values) {
    const int64_t line = (int64_t)width * channels;
    for (int64_t i = 0; i < height * line; i++) coefficients[i] = image[i];
    spline_filter(coefficients, height, line, line);
    for (int32_t y = 0; y < height; y++) spline_filter(coefficients + y * line, width, channels, channels);
    for (int64_t i = 0; i < count; i++, points += 2, values += channels) {
        double across[4], down[4];
        int64_t columns[4], rows[4];
        spline_weights(points[0], width, across, columns, channels);
        spline_weights(points[1], height, down, rows, line);
        if (channels == 3)
            spline_sum(3, coefficients, rows, columns, down, across, values);
        else
            for (int32_t c = 0; c < channels; c++)
                spline_sum(1, coefficients + c, rows, columns, down, across, values + c);
    }
}

/* libvips' tables: places between two pixels are rounded to a 64th, weights of integers to a 4096th. */
enum { PLACES = 64, UNIT = 4096 };

static void catmull_weights(double *weights, int32_t *whole) {
    for (int32_t place = 0; place <= PLACES; place++) {
        const double x = (float)place / PLACES, u = 1.0 - x, v = -0.5 * x * u, first = u * v, last = x * v;
        const double both = last - first;
        double *own = weights + 4 * place;
        own[0] = first;
        own[1] = u - first + both;
        own[2] = x - last - both;
        own[3] = last;
        for (int32_t k = 0; k < 4; k++) whole[4 * place + k] = (int32_t)(own[k] * UNIT);
    }
}

static inline int32_t within(int32_t i, int32_t size) { return i < 0 ? 0 : i >= size ? size - 1 : i; }

#define CATMULL(NAME, TYPE, WEIGHT, LINE, ROUNDED, LIMITED)                                                         \
    static inline void NAME(                                                                                        \
        int32_t channels, const TYPE *image, const int64_t *rows, const int64_t *columns, const WEIGHT *down,       \
        const WEIGHT *across, TYPE *values) {                                                                       \
        for (int32_t c = 0; c < channels; c++) {                                                                    \
            LINE line[4];                                                                                           \
            for (int32_t r = 0; r < 4; r++) {                                                                       \
                const TYPE *own = image + rows[r] + c;                                                              \
                line[r] = ROUNDED(                                                                                  \
                    across[0] * own[columns[0]] + across[1] * own[columns[1]] + across[2] * own[columns[2]] +       \
                    across[3] * own[columns[3]]);                                                                   \
            }                                                                                                       \
            const WEIGHT sum =                                                                                      \
                ROUNDED(down[0] * line[0] + down[1] * line[1] + down[2] * line[2] + down[3] * line[3]);             \
            values[c] = LIMITED(sum);                                                                               \
        }                                                                                                           \
    }

#define TO_UNIT(x) (((x) + UNIT / 2) >> 12)
#define TO_BYTE(x) (uint8_t)((x) < 0 ? 0 : (x) > UINT8_MAX ? UINT8_MAX : (x))
#define TO_WORD(x) (uint16_t)((x) < 0 ? 0 : (x) > UINT16_MAX ? UINT16_MAX : (x))
#define AS_FLOAT(x) (float)(x)
CATMULL(catmull_byte, uint8_t, int32_t, int32_t, TO_UNIT, TO_BYTE)
CATMULL(catmull_word, uint16_t, double, double, , TO_WORD)
CATMULL(catmull_float, float, double, float, , AS_FLOAT)

#ifdef __SSE2__
/* The same as catmull_byte for three channels, whose pixels lie in 16 bytes of each of four lines. */
static inline void catmull_colours(
    const uint8_t *image, int64_t line, const int32_t *down, const int32_t *across, uint8_t *values) {
#define PAIR(weights, k) _mm_set1_epi32((int32_t)((uint32_t)weights[k + 1] << 16 | ((uint32_t)weights[k] & 0xffff)))
#define WEIGHTED(one, other, weights)                                                                               \
    _mm_srai_epi32(                                                                                                 \
        _mm_add_epi32(                                                                                              \
            _mm_add_epi32(_mm_madd_epi16(one, PAIR(weights, 0)), _mm_madd_epi16(other, PAIR(weights, 2))),          \
            _mm_set1_epi32(UNIT / 2)),                                                                              \
        12)
    const __m128i zero = _mm_setzero_si128();
    __m128i found[4];
    for (int32_t r = 0; r < 4; r++) {
        const __m128i own = _mm_loadu_si128((const __m128i *)(image + r * line));
        const __m128i one = _mm_unpacklo_epi8(own, _mm_srli_si128(own, 3));
        const __m128i other = _mm_unpacklo_epi8(_mm_srli_si128(own, 6), _mm_srli_si128(own, 9));
        const __m128i sum = WEIGHTED(_mm_unpacklo_epi8(one, zero), _mm_unpacklo_epi8(other, zero), across);
        found[r] = _mm_packs_epi32(sum, sum);
    }
    const __m128i sum =
        WEIGHTED(_mm_unpacklo_epi16(found[0], found[1]), _mm_unpacklo_epi16(found[2], found[3]), down);
    const __m128i words = _mm_packs_epi32(sum, sum);
    const int32_t bytes = _mm_cvtsi128_si32(_mm_packus_epi16(words, words));
    memcpy(values, &bytes, 3);
#undef PAIR
#undef WEIGHTED
}
#endif

/* Values (count, channels) of an image (height, width, channels) whose pixels have that many bytes (1, 2, or 4 for
   floats) at points (count, 2) x and y, from whose y `top` is taken off; where shown is 0 they are 0. Beyond the edge the
   outermost pixels go on. */
EXPORTED void catmull_values(
    int32_t bytes, int32_t height, int32_t width, int32_t channels, const void *image, int64_t count,
    const double *points, double top, const uint8_t *shown, void *values) {
    double weights[4 * (PLACES + 1)];
    int32_t whole[4 * (PLACES + 1)];
    catmull_weights(weights, whole);
    const int64_t line = (int64_t)width * channels;
    for (int64_t i = 0; i < count; i++) {
        if (!shown[i]) {
            for (int32_t b = 0; b < bytes * channels; b++) ((uint8_t *)values)[i * bytes * channels + b] = 0;
            continue;
        }
        /* libvips counts from two pixels beyond the upper left one, in floats, one pixel after the other. */
        const float near_x = (float)points[2 * i] + 1.0f, near_y = (float)(points[2 * i + 1] - top) + 1.0f;
        const float x = near_x + 1.0f, y = near_y + 1.0f;
        const int32_t fine_x = ((int32_t)(x * (2.0f * PLACES)) & (2 * PLACES - 1)) + 1;
        const int32_t fine_y = ((int32_t)(y * (2.0f * PLACES)) & (2 * PLACES - 1)) + 1;
        const int32_t left = (int32_t)x - 3, upper = (int32_t)y - 3;
        const int32_t a = 4 * (fine_x >> 1), d = 4 * (fine_y >> 1);
#ifdef __SSE2__
        if (bytes == 1 && channels == 3 && left >= 0 && left + 6 <= width && upper >= 0 && upper + 4 <= height) {
            const uint8_t *own = (const uint8_t *)image + upper * line + 3 * (int64_t)left;
            catmull_colours(own, line, whole + d, whole + a, (uint8_t *)values + i * 3);
            continue;
        }
#endif
        int64_t rows[4], columns[4];
        for (int32_t k = 0; k < 4; k++) {
            rows[k] = within(upper + k, height) * line;
            columns[k] = (int64_t)within(left + k, width) * channels;
        }
        if (bytes == 1 && channels == 3)
            catmull_byte(3, image, rows, columns, whole + d, whole + a, (uint8_t *)values + i * 3);
        else if (bytes == 1)
            catmull_byte(channels, image, rows, columns, whole + d, whole + a, (uint8_t *)values + i * channels);
        else if (bytes == 2)
            catmull_word(channels, image, rows, columns, weights + d, weights + a, (uint16_t *)values + i * channels);
        else
            catmull_float(channels, image, rows, columns, weights + d, weights + a, (float *)values + i * channels);
    }
}
