// overlaps.c: a tree of boxes in the order of a space-filling curve, halved again and again, met with itself.
#include "shape/overlaps.h"

#include <math.h>
#include <stdlib.h>

enum { LEAF = 4, BITS = 10 };

typedef struct Ordered {
    uint32_t code;
    int32_t box;
} Ordered;

typedef struct Search {
    const Box *boxes;
    Ordered *order;
    Box *nodes; // children of node i: 2 i + 1 and 2 i + 2
    OverlapFn *found;
    void *user;
} Search;

// A node and the part of the order that it holds.
typedef struct Part {
    int32_t node, first, count;
} Part;

static int compare_codes(const void *a, const void *b) {
    const Ordered *x = a, *y = b;
    if (x->code != y->code) {
        return x->code < y->code ? -1 : 1;
    }
    return (x->box > y->box) - (x->box < y->box);
}

static uint32_t spread(uint32_t x) {
    uint32_t code = 0;
    for (int bit = 0; bit < BITS; bit++) {
        code |= (x >> bit & 1) << 3 * bit;
    }
    return code;
}

static Box box_union(Box a, Box b) {
    for (int k = 0; k < 3; k++) {
        a.low[k] = fminf(a.low[k], b.low[k]);
        a.high[k] = fmaxf(a.high[k], b.high[k]);
    }
    a.moves |= b.moves;
    a.family = a.family == b.family ? a.family : -1;
    return a;
}

static bool may_meet(const Box *a, const Box *b) {
    bool left_out = (!a->moves && !b->moves) || (a->family >= 0 && a->family == b->family);
    return !left_out && !rey_boxes_apart(a, b);
}

typedef struct Place {
    float at;
    int32_t box;
} Place;

static int compare_places(const void *a, const void *b) {
    const Place *x = a, *y = b;
    return (x->at > y->at) - (x->at < y->at);
}

// By how many boxes lie on either side along each axis, and not by where they do: beside a plane that is a thousand times as large
// all others would be in one place.
static void sort_boxes(const Box *boxes, int32_t count, Ordered *order, Place *places) {
    for (int32_t i = 0; i < count; i++) {
        order[i] = (Ordered){0, i};
    }
    for (int k = 0; k < 3; k++) {
        for (int32_t i = 0; i < count; i++) {
            places[i] = (Place){0.5f * (boxes[i].low[k] + boxes[i].high[k]), i};
        }
        qsort(places, (size_t)count, sizeof *places, compare_places);
        for (int32_t i = 0, rank = 0; i < count; i++) {
            rank = i > 0 && places[i].at > places[i - 1].at ? i : rank;
            order[places[i].box].code |= spread((uint32_t)((int64_t)rank * ((1 << BITS) - 1) / count)) << k;
        }
    }
    qsort(order, (size_t)count, sizeof *order, compare_codes);
}

static Part half_of(Part p, int which) {
    int32_t left = p.count / 2;
    return which ? (Part){2 * p.node + 2, p.first + left, p.count - left} : (Part){2 * p.node + 1, p.first, left};
}

static Box build(Search *s, Part p) {
    Box box = s->boxes[s->order[p.first].box];
    if (p.count <= LEAF) {
        for (int32_t i = 1; i < p.count; i++) {
            box = box_union(box, s->boxes[s->order[p.first + i].box]);
        }
    } else {
        box = box_union(build(s, half_of(p, 0)), build(s, half_of(p, 1)));
    }
    return s->nodes[p.node] = box;
}

static rey_result meet_leaves(Search *s, Part a, Part b) {
    rey_result result = REY_OK;
    for (int32_t i = 0; i < a.count; i++) {
        for (int32_t k = a.node == b.node ? i + 1 : 0; k < b.count && result == REY_OK; k++) {
            int32_t x = s->order[a.first + i].box, y = s->order[b.first + k].box;
            if (may_meet(s->boxes + x, s->boxes + y)) {
                result = s->found(s->user, x < y ? x : y, x < y ? y : x);
            }
        }
    }
    return result;
}

static rey_result meet(Search *s, Part a, Part b) {
    if (!may_meet(s->nodes + a.node, s->nodes + b.node)) {
        return REY_OK;
    }
    if (a.count <= LEAF && b.count <= LEAF) {
        return meet_leaves(s, a, b);
    }
    rey_result result = REY_OK;
    if (a.node == b.node) {
        Part left = half_of(a, 0), right = half_of(a, 1);
        result = meet(s, left, left);
        result = result == REY_OK ? meet(s, right, right) : result;
        return result == REY_OK ? meet(s, left, right) : result;
    }
    bool cut_a = a.count >= b.count;
    for (int i = 0; i < 2 && result == REY_OK; i++) {
        result = cut_a ? meet(s, half_of(a, i), b) : meet(s, a, half_of(b, i));
    }
    return result;
}

rey_result rey_overlaps_find(rey_context *ctx, const Box *boxes, int32_t count, OverlapFn *found, void *user) {
    size_t nodes = 1;
    for (int32_t left = count; left > LEAF; left -= left / 2) {
        nodes = 2 * nodes + 1;
    }
    Search s = {boxes, rey_alloc_array(ctx, (size_t)count + 1, sizeof *s.order), NULL, found, user};
    Place *places = rey_alloc_array(ctx, (size_t)count + 1, sizeof *places);
    s.nodes = s.order ? rey_alloc_array(ctx, nodes, sizeof *s.nodes) : NULL;
    rey_result result = s.nodes && places ? REY_OK : REY_ERROR_MEMORY;
    if (result == REY_OK && count > 1) {
        sort_boxes(boxes, count, s.order, places);
        Part all = {0, 0, count};
        build(&s, all);
        result = meet(&s, all, all);
    }
    rey_free(ctx, places);
    rey_free(ctx, s.nodes);
    rey_free(ctx, s.order);
    return result;
}
