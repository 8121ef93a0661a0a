/* The stack of rays: what is pushed comes back once, and it never has more than it holds, whatever
 * the tree; what guards the columns. */
#include "wide_test.h"

#include <stdio.h>
#include <stdlib.h>

#include "core/core.h"
#include "kernels/tile/ray_stack.h"

#if TRC_GUARD_BYTES
#include <sys/wait.h>
#include <unistd.h>
#endif

struct stacks {
    void *memory;
    struct trc_carver carver;
    struct trc_ray_store stack, work;
};

static void stacks_make(struct stacks *s, uint32_t capacity) {
    struct trc_carver c = {0};
    for (int turn = 0; turn < 2; turn++) {
        trc_rays_carve(&c, &s->stack, capacity,
                       (struct trc_ray_columns){true, true, true, true, true});
        trc_rays_carve(&c, &s->work, capacity,
                       (struct trc_ray_columns){true, true, true, true, true});
        if (turn == 0) {
            s->memory = trc_alloc(c.used, 1);
            assert_non_null(s->memory);
            c = (struct trc_carver){.base = s->memory};
        }
    }
    s->carver = c;
}

/* A ray's number is in all its columns, its depth in one. */
static void ray_append(struct trc_ray_store *r, uint32_t number, uint32_t depth, uint32_t bits) {
    vfloat values[TRC_RAY_FLOATS];
    vuint words[TRC_RAY_WORDS];
    const vuint numbers = vu_set(number) + (vuint)vi_lane();
    for (int k = 0; k < TRC_RAY_FLOATS; k++)
        values[k] = vi_to_float((vint)numbers);
    for (int k = 0; k < TRC_RAY_WORDS; k++)
        words[k] = numbers;
    words[TRC_RAY_DEPTHS] = vu_set(depth);
    trc_rays_append(r, values, words, bits);
}

static uint32_t number_of(const struct trc_ray_store *r, uint32_t ray) {
    const uint32_t number = r->w[TRC_RAY_SLOT][ray];
    for (int k = 0; k < TRC_RAY_FLOATS; k++)
        assert_int_equal((uint32_t)r->f[k][ray], number);
    for (int k = 0; k < TRC_RAY_WORDS; k++)
        if (k != TRC_RAY_DEPTHS)
            assert_int_equal(r->w[k][ray], number);
    return number;
}

/* ---- trees ---- */

/* How many rays one leaves; is_top: of those that its parent left, the one on top. */
typedef uint32_t children_rule(struct rng *rng, uint32_t branches, uint32_t depth, bool is_top);

/* Whole for a few bounces, which fills the stack, then one ray goes on to the end of each path. */
static uint32_t combs(struct rng *rng, uint32_t branches, uint32_t depth, bool is_top) {
    (void)rng;
    return depth < 2 || is_top ? branches : 0;
}

/* Each ray on its own, so that a tree goes on for long, or not. */
static uint32_t random_trees(struct rng *rng, uint32_t branches, uint32_t depth, bool is_top) {
    (void)is_top;
    return depth < 2 || rng_below(rng, branches + 1) == 0 ? branches : 0;
}

/* Numbers stay exact in floats. */
#define NUMBERS (1u << 22)
#define IS_TOP 0x10000u

struct growth {
    uint64_t pushed, taken, sum; /* the sum of the numbers taken, less that of those pushed */
    uint32_t most, single_steps;
};

static void children_append(struct trc_ray_store *r, uint32_t count, uint32_t depth,
                            struct growth *g) {
    while (count) {
        /* The one on top comes alone, to be marked. */
        const uint32_t lanes = count == 1 ? 1 : count - 1 < TRC_WIDTH ? count - 1 : TRC_WIDTH;
        const uint32_t number = (uint32_t)(g->pushed % NUMBERS);
        ray_append(r, number, depth | (count == 1 ? IS_TOP : 0),
                   (uint32_t)((UINT64_C(1) << lanes) - 1));
        for (uint32_t k = 0; k < lanes; k++)
            g->sum -= number + k;
        g->pushed += lanes;
        count -= lanes;
    }
}

/* Follows the trees of so many rays in a stack of that room. */
static struct growth follow(const struct trc_ray_room *room, uint32_t last_depth, uint32_t rays,
                            children_rule *children) {
    struct rng rng = rng_seed(room->branches);
    struct growth g = {0};
    struct stacks s;
    stacks_make(&s, room->capacity);
    trc_rays_reserve(&s.stack, rays);
    children_append(&s.stack, rays, 0, &g);
    while (s.stack.count) {
        const uint32_t step = trc_rays_step(&s.stack, room);
        assert_in_range(step, 1, TRC_BATCH);
        g.single_steps += step == 1 && s.stack.count > 1;
        trc_rays_take(&s.stack, &s.work, step);
        assert_int_equal(s.work.count, step);
        trc_rays_reserve(&s.stack, s.work.count * room->branches);
        for (uint32_t i = 0; i < s.work.count; i++) {
            const uint32_t word = s.work.w[TRC_RAY_DEPTHS][i], depth = word & ~IS_TOP;
            g.taken++;
            g.sum += number_of(&s.work, i);
            if (depth < last_depth)
                children_append(&s.stack, children(&rng, room->branches, depth, word & IS_TOP),
                                depth + 1, &g);
        }
        g.most = s.stack.count > g.most ? s.stack.count : g.most;
        assert_true(s.stack.count <= room->capacity);
    }
    assert_true(trc_carver_check(&s.carver));
    trc_free(s.memory);
    assert_true(g.taken == g.pushed && g.sum == 0);
    return g;
}

static void trees(void **state) {
    (void)state;
    static const struct {
        uint32_t branches, max_depth, max_transparent_depth, rays;
        uint32_t room; /* besides that of one path; 0: as the library has it */
        children_rule *children;
    } cases[] = {
        {1, 3, 0, TRC_BATCH, 0, random_trees}, {9, 3, 0, TRC_BATCH, 0, random_trees},
        {2, 20, 8, TRC_BATCH, 0, combs},       {3, 20, 8, TRC_BATCH, 0, random_trees},
        {4, 254, 254, 50, 0, combs},           {48, 254, 254, 1, 0, combs},
        {3, 30, 20, 100, 100, combs},          {24, 30, 20, 16, 16, combs},
        {2, 254, 254, 200, 200, combs},        {5, 40, 8, 64, 70, random_trees},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const trc_render_desc desc = {.max_depth = cases[i].max_depth,
                                      .max_transparent_depth = cases[i].max_transparent_depth};
        struct trc_ray_room room = trc_ray_room_of(&desc, cases[i].branches);
        if (cases[i].room)
            room.capacity = room.depth + cases[i].room;
        const struct growth g = follow(&room, desc.max_depth + desc.max_transparent_depth + 1,
                                       cases[i].rays, cases[i].children);
        print_message("%u branches: %llu rays, up to %u of %u waited, %u steps of one ray\n",
                      room.branches, (unsigned long long)g.taken, g.most, room.capacity,
                      g.single_steps);
        assert_int_equal(g.single_steps > 0, cases[i].room > 0);
    }
}

/* ---- steps ---- */

/* The rule by itself: from any count, steps that leave all they may end with the stack's own room
 * for one path untouched, and that path fits. */
static void steps_fit(void **state) {
    (void)state;
    for (uint32_t branches = 2; branches <= 48; branches++) {
        const trc_render_desc desc = {.max_depth = branches * 5, .max_transparent_depth = branches};
        const struct trc_ray_room room = trc_ray_room_of(&desc, branches);
        struct trc_ray_store r = {.capacity = room.capacity};
        for (r.count = 1; r.count <= room.capacity - room.depth; r.count++) {
            const uint32_t step = trc_rays_step(&r, &room);
            const uint32_t after = r.count + step * (branches - 1);
            if (step < 1 || (step > 1 && after > room.capacity - room.depth) ||
                (r.count <= TRC_WAITING_RAYS && step < TRC_BATCH && step < r.count))
                fail_msg("%u branches: of %u rays %u are taken", branches, r.count, step);
        }
        uint32_t count = room.capacity - room.depth; /* of one path */
        for (uint32_t depth = 0; depth < desc.max_depth + desc.max_transparent_depth + 2; depth++)
            count += branches - 1;
        assert_true(count <= room.capacity);
    }
}

/* ---- guards ---- */

#if TRC_GUARD_BYTES
/* Whether a process that does it ends as it should not. */
static bool is_caught(void (*misuse)(struct stacks *)) {
    struct stacks s;
    stacks_make(&s, TRC_BATCH);
    const pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        if (!freopen("/dev/null", "w", stderr))
            _exit(1);
        misuse(&s);
        _exit(trc_carver_check(&s.carver) ? 0 : 1);
    }
    int status = 0;
    assert_int_equal(waitpid(child, &status, 0), child);
    trc_free(s.memory);
    return !(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

static void nothing(struct stacks *s) { s->stack.f[TRC_RAY_OX][TRC_BATCH] = 1.0f; }

static void write_behind_a_column(struct stacks *s) {
    volatile float *column = s->stack.f[TRC_RAY_OX];
    const uint32_t line = TRC_CARVER_ALIGNMENT / sizeof(float);
    column[(TRC_BATCH + TRC_WIDTH + line - 1) / line * line] = 1.0f;
}

static void append_too_many(struct stacks *s) {
    trc_rays_reserve(&s->stack, TRC_WIDTH);
    ray_append(&s->stack, 0, 0, TRC_LANE_BITS);
    ray_append(&s->stack, 0, 0, 1);
}

static void reserve_too_many(struct stacks *s) { trc_rays_reserve(&s->stack, TRC_BATCH + 1); }

/* What was reserved ends when rays are taken, all or some. */
static void append_after_take_all(struct stacks *s) {
    trc_rays_reserve(&s->stack, 2 * TRC_WIDTH);
    ray_append(&s->stack, 0, 0, TRC_LANE_BITS);
    trc_rays_take(&s->stack, &s->work, TRC_WIDTH);
    ray_append(&s->stack, 0, 0, TRC_LANE_BITS);
}

static void append_after_take_some(struct stacks *s) {
    trc_rays_reserve(&s->stack, 4);
    ray_append(&s->stack, 0, 0, 1);
    ray_append(&s->stack, 1, 0, 1);
    trc_rays_take(&s->stack, &s->work, 1);
    ray_append(&s->stack, 2, 0, 1);
}

static void append_to_taken(struct stacks *s) {
    trc_rays_reserve(&s->work, TRC_BATCH);
    trc_rays_reserve(&s->stack, 1);
    ray_append(&s->stack, 0, 0, 1);
    trc_rays_take(&s->stack, &s->work, 1);
    ray_append(&s->work, 1, 0, 1);
}

static void guards(void **state) {
    (void)state;
    assert_false(is_caught(nothing));
    assert_true(is_caught(write_behind_a_column));
    assert_true(is_caught(append_too_many));
    assert_true(is_caught(reserve_too_many));
    assert_true(is_caught(append_after_take_all));
    assert_true(is_caught(append_after_take_some));
    assert_true(is_caught(append_to_taken));
}
#else
static void guards(void **state) {
    (void)state;
    skip(); /* release builds have none */
}
#endif

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(trees), cmocka_unit_test(steps_fit),
                                       cmocka_unit_test(guards)};
    if (!test_cpu_can())
        return 77;
    return cmocka_run_group_tests_name("ray stack", tests, NULL, NULL);
}
