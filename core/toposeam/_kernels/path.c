/* The cheapest path between two corners of a lattice (Dijkstra 1959, doi:10.1007/BF01386390), by a heap with four
   branches. It ends at the target; of equal lengths the one found first goes on, so that paths are straight where steps
   cost nothing. */
#include "kernels.h"

#include <math.h>
#include <stdlib.h>

enum { BRANCHES = 4 };
enum { UP, LEFT, RIGHT, DOWN, NOWHERE };

/* A corner that was reached: how far it is, and when that was found. */
typedef struct {
    double far;
    int32_t turn, corner;
} Reached;

typedef struct {
    Reached *all;
    int64_t count, room;
} Heap;

static inline int before(const Reached *one, const Reached *other) {
    return one->far < other->far || (one->far == other->far && one->turn < other->turn);
}

static int put(Heap *heap, Reached own) {
    if (heap->count == heap->room) {
        Reached *more = realloc(heap->all, 2 * heap->room * sizeof *more);
        if (!more) return 0;
        heap->all = more;
        heap->room *= 2;
    }
    int64_t at = heap->count++;
    while (at > 0) {
        const int64_t parent = (at - 1) / BRANCHES;
        if (!before(&own, &heap->all[parent])) break;
        heap->all[at] = heap->all[parent];
        at = parent;
    }
    heap->all[at] = own;
    return 1;
}

static Reached take(Heap *heap) {
    const Reached first = heap->all[0], own = heap->all[--heap->count];
    int64_t at = 0;
    for (;;) {
        const int64_t child = BRANCHES * at + 1;
        if (child >= heap->count) break;
        int64_t least = child;
        for (int64_t k = child + 1; k < child + BRANCHES && k < heap->count; k++)
            if (before(&heap->all[k], &heap->all[least])) least = k;
        if (!before(&heap->all[least], &own)) break;
        heap->all[at] = heap->all[least];
        at = least;
    }
    heap->all[at] = own;
    return first;
}

/* Corners (height, width); below[i] is the cost of the step down from corner i, beside[i] of that to the right, infinite
   where there is none. Writes the way back from each corner that is reached into `back`, (height, width), the path's
   length into `length`, and returns 1; 0 where no path is as short as the limit, -1 without memory. */
EXPORTED int32_t cheapest_way(
    int32_t height, int32_t width, const float *below, const float *beside, int32_t source, int32_t target,
    double limit, uint8_t *back, double *length) {
    const int32_t count = height * width;
    double *far = malloc(count * sizeof *far);
    Heap heap = {malloc(4096 * sizeof(Reached)), 0, 4096};
    int32_t turn = 0, found = 0;
    if (!far || !heap.all) found = -1;
    for (int32_t i = 0; !found && i < count; i++) {
        far[i] = INFINITY;
        back[i] = NOWHERE;
    }
    if (!found) {
        far[source] = 0;
        put(&heap, (Reached){0, turn++, source});
    }
    while (!found && heap.count) {
        const Reached own = take(&heap);
        const int32_t i = own.corner;
        if (own.far > far[i]) continue;
        if (i == target) {
            found = 1;
            *length = own.far;
            break;
        }
        const int32_t there[4] = {i - width, i - 1, i + 1, i + width};
        const float cost[4] = {
            i >= width ? below[i - width] : INFINITY, i >= 1 ? beside[i - 1] : INFINITY,
            i + 1 < count ? beside[i] : INFINITY, i + width < count ? below[i] : INFINITY};
        for (int32_t k = 0; k < 4; k++) {
            const double next = own.far + cost[k];
            if (isinf(next) || next > limit || next >= far[there[k]]) continue; /* perhaps no corner */
            far[there[k]] = next;
            back[there[k]] = (uint8_t)(DOWN - k);
            if (!put(&heap, (Reached){next, turn++, there[k]})) {
                found = -1;
                break;
            }
        }
    }
    free(far);
    free(heap.all);
    return found;
}
