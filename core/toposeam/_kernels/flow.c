/* The smallest hot side of a minimum cut, by maximum flow with two search trees that are kept between augmenting
   paths (Boykov and Kolmogorov 2004, doi:10.1109/TPAMI.2004.60).

   A tree grows from the hot terminal, one from the cold one. Where they touch, flow is sent along the path between
   their roots. Nodes that it cuts off, the orphans, look for another parent in their tree; those that find none
   leave it. Marks say which nodes are known to hang on a root since the last path, and how far away. */
#include "kernels.h"

#include <stdlib.h>
#include <string.h>

enum { FREE, HOT, COLD };
enum { NOBODY = -1, ROOT = -1, NO_PARENT = -2 };

/* From a node to a neighbour: what may still flow there, and the arc in the other direction. */
typedef struct {
    int32_t to, back, left;
} Arc;

typedef struct {
    int32_t arcs;      /* the first arc; those of a node lie one after the other */
    int32_t parent;    /* the arc to it, or ROOT, or NO_PARENT */
    int32_t excess;    /* what the hot terminal can still send, or minus what the cold one can still take */
    int32_t next;      /* in the queue of active nodes */
    int32_t mark, far; /* when it was last known to hang on a root, and the number of nodes up to there */
    uint8_t tree, queued;
} Node;

typedef struct {
    Node *nodes;
    Arc *arcs;
    int32_t *orphans;
    int32_t orphan_count;
    int32_t first, last; /* active nodes, whose arcs are to be looked at */
    int32_t now;         /* number of paths so far */
} Flow;

static inline void activate(Flow *flow, int32_t at) {
    Node *node = &flow->nodes[at];
    if (node->queued) return;
    node->queued = 1;
    node->next = NOBODY;
    if (flow->last == NOBODY)
        flow->first = at;
    else
        flow->nodes[flow->last].next = at;
    flow->last = at;
}

static inline void orphan(Flow *flow, int32_t at) {
    flow->nodes[at].parent = NO_PARENT;
    flow->orphans[flow->orphan_count++] = at;
}

/* What may still flow between the ends of an arc: away from the root of the tree, if it leads to the parent. */
static inline int32_t *outward(Flow *flow, int32_t arc, int tree) {
    return tree == HOT ? &flow->arcs[flow->arcs[arc].back].left : &flow->arcs[arc].left;
}

/* Count the nodes from one up to its root, and mark them; 0 where it hangs on none. */
static inline int32_t far_from_root(Flow *flow, int32_t at) {
    Node *nodes = flow->nodes;
    int32_t far = 0, up = at;
    while (nodes[up].mark != flow->now) {
        far++;
        if (nodes[up].parent == NO_PARENT) return 0;
        if (nodes[up].parent == ROOT) {
            nodes[up].mark = flow->now;
            nodes[up].far = 1;
            far--;
            break;
        }
        up = flow->arcs[nodes[up].parent].to;
    }
    far += nodes[up].far;
    for (int32_t left = far; nodes[at].mark != flow->now; at = flow->arcs[nodes[at].parent].to) {
        nodes[at].mark = flow->now;
        nodes[at].far = left--;
    }
    return far;
}

/* Find the parent nearest to a root for each orphan; those without one leave their tree. */
static void adopt(Flow *flow) {
    Node *nodes = flow->nodes;
    const Arc *arcs = flow->arcs;
    for (int32_t k = 0; k < flow->orphan_count; k++) {
        const int32_t at = flow->orphans[k];
        Node *node = &nodes[at];
        const int tree = node->tree;
        int32_t parent = NO_PARENT, least = INT32_MAX;
        for (int32_t a = node->arcs; a < node[1].arcs; a++) {
            if (nodes[arcs[a].to].tree != tree || !*outward(flow, a, tree)) continue;
            const int32_t far = far_from_root(flow, arcs[a].to);
            if (far && far < least) {
                least = far;
                parent = a;
            }
        }
        node->parent = parent;
        if (parent != NO_PARENT) {
            node->mark = flow->now;
            node->far = least + 1;
            continue;
        }
        node->tree = FREE;
        for (int32_t a = node->arcs; a < node[1].arcs; a++) {
            const int32_t to = arcs[a].to;
            if (nodes[to].tree != tree) continue;
            if (*outward(flow, a, tree)) activate(flow, to);
            if (nodes[to].parent == arcs[a].back) orphan(flow, to);
        }
    }
    flow->orphan_count = 0;
}

static inline int32_t least_on_way(Flow *flow, int32_t at, int tree, int32_t most) {
    const Node *nodes = flow->nodes;
    for (; nodes[at].parent != ROOT; at = flow->arcs[nodes[at].parent].to) {
        const int32_t left = *outward(flow, nodes[at].parent, tree);
        if (left < most) most = left;
    }
    const int32_t excess = tree == HOT ? nodes[at].excess : -nodes[at].excess;
    return excess < most ? excess : most;
}

static inline void send_on_way(Flow *flow, int32_t at, int tree, int32_t amount) {
    Node *nodes = flow->nodes;
    while (nodes[at].parent != ROOT) {
        const int32_t up = nodes[at].parent, child = at;
        int32_t *left = outward(flow, up, tree);
        *outward(flow, up, HOT + COLD - tree) += amount;
        *left -= amount;
        at = flow->arcs[up].to;
        if (!*left) orphan(flow, child);
    }
    nodes[at].excess -= tree == HOT ? amount : -amount;
    if (!nodes[at].excess) orphan(flow, at);
}

/* Send what fits through an arc from the hot tree to the cold one. */
static void augment(Flow *flow, int32_t arc) {
    const int32_t back = flow->arcs[arc].back, cold = flow->arcs[arc].to, hot = flow->arcs[back].to;
    int32_t amount = least_on_way(flow, hot, HOT, flow->arcs[arc].left);
    amount = least_on_way(flow, cold, COLD, amount);
    flow->now++;
    flow->arcs[arc].left -= amount;
    flow->arcs[back].left += amount;
    send_on_way(flow, hot, HOT, amount);
    send_on_way(flow, cold, COLD, amount);
    for (int32_t i = 0, j = flow->orphan_count - 1; i < j; i++, j--) { /* those near the roots first */
        const int32_t other = flow->orphans[i];
        flow->orphans[i] = flow->orphans[j];
        flow->orphans[j] = other;
    }
    adopt(flow);
}

/* Let a node take in its free neighbours; returns an arc from the hot tree to the cold one, if it is beside one. */
static inline int32_t touching(Flow *flow, int32_t at, int tree) {
    Node *nodes = flow->nodes, *node = &nodes[at];
    const Arc *arcs = flow->arcs;
    for (int32_t a = node->arcs; a < node[1].arcs; a++) {
        const int32_t out = tree == HOT ? a : arcs[a].back;
        if (!arcs[out].left) continue;
        Node *other = &nodes[arcs[a].to];
        if (other->tree == FREE) {
            other->tree = node->tree;
            activate(flow, arcs[a].to);
        } else if (other->tree != tree)
            return out;
        else if (other->mark > node->mark || other->far <= node->far)
            continue;
        other->parent = arcs[a].back;
        other->mark = node->mark;
        other->far = node->far + 1;
    }
    return NOBODY;
}

/* Lay out the nodes and arcs of elements; what can flow through a node from terminal to terminal flows. */
static void build(
    Flow *flow, int32_t n, int64_t count, const int32_t *tail, const int32_t *head, const int32_t *capacity) {
    Node *nodes = flow->nodes;
    for (int64_t e = 0; e < count; e++) {
        const int32_t p = tail[e], q = head[e];
        if (p < n && q < n) {
            nodes[p].arcs++;
            nodes[q].arcs++;
        } else if (p < n || q < n)
            nodes[p < n ? p : q].excess += (p < n ? q : p) == n + 1 ? capacity[e] : -capacity[e];
    }
    for (int32_t v = 1; v <= n; v++) nodes[v].arcs += nodes[v - 1].arcs;
    for (int64_t e = count - 1; e >= 0; e--) {
        const int32_t p = tail[e], q = head[e];
        if (p >= n || q >= n) continue;
        const int32_t a = --nodes[p].arcs, b = --nodes[q].arcs;
        flow->arcs[a] = (Arc){q, b, capacity[e]};
        flow->arcs[b] = (Arc){p, a, capacity[e]};
    }
    flow->first = flow->last = NOBODY;
    for (int32_t v = 0; v < n; v++) {
        nodes[v].parent = nodes[v].excess ? ROOT : NO_PARENT;
        nodes[v].tree = nodes[v].excess > 0 ? HOT : nodes[v].excess < 0 ? COLD : FREE;
        nodes[v].far = 1;
        if (nodes[v].excess) activate(flow, v);
    }
}

/* n free nodes, n the cold terminal, n + 1 the hot one; `count` elements that carry up to their capacity either way;
   all capacities add up to less than 2^30. Sets hot[v] to 1 on the smallest hot side, and else to 0. Returns 0, or -1
   where there is no memory. */
EXPORTED int smallest_hot_side(
    int32_t n, int64_t count, const int32_t *tail, const int32_t *head, const int32_t *capacity, uint8_t *hot) {
    Flow flow;
    memset(&flow, 0, sizeof flow);
    flow.nodes = calloc((size_t)n + 1, sizeof *flow.nodes);
    flow.arcs = malloc((2 * (size_t)count + 1) * sizeof *flow.arcs);
    flow.orphans = malloc(((size_t)n + 1) * sizeof *flow.orphans);
    const int there = flow.nodes && flow.arcs && flow.orphans;
    if (there) {
        build(&flow, n, count, tail, head, capacity);
        while (flow.first != NOBODY) {
            const int32_t at = flow.first;
            Node *node = &flow.nodes[at];
            while (node->tree != FREE) {
                const int32_t arc = node->tree == HOT ? touching(&flow, at, HOT) : touching(&flow, at, COLD);
                if (arc == NOBODY) break;
                augment(&flow, arc);
            }
            flow.first = node->next;
            if (flow.first == NOBODY) flow.last = NOBODY;
            node->queued = 0;
        }
        for (int32_t v = 0; v < n; v++) hot[v] = flow.nodes[v].tree == HOT;
    }
    free(flow.nodes);
    free(flow.arcs);
    free(flow.orphans);
    return there ? 0 : -1;
}
