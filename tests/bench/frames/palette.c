#include "palette.h"

/* GGX roughness of glossy surfaces: about the lobe of a Phong exponent of 200. */
#define ROUGHNESS 0.3f
/* Of SURFACE_MIRROR and SURFACE_GLOSSY; the rest is diffuse. */
#define REFLECTING_SHARE 0.5f
#define GLASS_INDEX 1.45f
#define CHECKER_SCALE 20.0f

#define PALETTE_NODES 4
#define PALETTE_INPUTS 16

struct graph {
    trc_node nodes[PALETTE_NODES];
    trc_node_input inputs[PALETTE_INPUTS];
    uint32_t node_count, input_count;
};

static trc_node_input number(float x) { return (trc_node_input){.node = -1, .value = {x, x, x}}; }
static trc_node_input colour(const float c[3]) {
    return (trc_node_input){.node = -1, .value = {c[0], c[1], c[2]}};
}
static trc_node_input link_to(int32_t node) { return (trc_node_input){.node = node}; }
static trc_node_input standard(void) { return (trc_node_input){.node = -2}; }

static int32_t node_add(struct graph *g, uint32_t type, uint32_t count,
                        const trc_node_input *inputs) {
    g->nodes[g->node_count] =
        (trc_node){.type = type, .first_input = g->input_count, .input_count = count};
    for (uint32_t i = 0; i < count; i++)
        g->inputs[g->input_count++] = inputs[i];
    return (int32_t)g->node_count++;
}

static int32_t diffuse(struct graph *g, trc_node_input color) {
    return node_add(g, TRC_NODE_DIFFUSE, 3,
                    (const trc_node_input[]){color, number(0.0f), standard()});
}

static int32_t reflecting(struct graph *g, float roughness) {
    return node_add(g, TRC_NODE_GLOSSY, 6,
                    (const trc_node_input[]){number(0.9f), number(roughness), number(0.0f),
                                             number(0.0f), standard(), standard()});
}

static int32_t glass(struct graph *g) {
    return node_add(g, TRC_NODE_GLASS, 6,
                    (const trc_node_input[]){number(0.95f), number(0.0f), number(GLASS_INDEX),
                                             standard(), number(0.0f), number(0.0f)});
}

static int32_t mixed(struct graph *g, float factor, int32_t first, int32_t second) {
    return node_add(g, TRC_NODE_MIX_SHADER, 3,
                    (const trc_node_input[]){number(factor), link_to(first), link_to(second)});
}

static int32_t checkered(struct graph *g, const float color[3]) {
    static const float dark[3] = {0.05f, 0.05f, 0.06f};
    const int32_t at = node_add(g, TRC_NODE_TEXTURE_COORDINATE, 0, NULL);
    return diffuse(
        g, link_to(node_add(g, TRC_NODE_CHECKER, 4,
                            (const trc_node_input[]){link_to(at), colour(color), colour(dark),
                                                     number(CHECKER_SCALE)})));
}

static int32_t surface_add(struct graph *g, enum surface surface, uint32_t slot, bool rough) {
    static const float colors[PALETTE_SIZE][3] = {
        {0.55f, 0.50f, 0.45f}, {0.50f, 0.52f, 0.55f}, {0.60f, 0.35f, 0.20f}, {0.25f, 0.45f, 0.30f},
        {0.20f, 0.30f, 0.55f}, {0.60f, 0.55f, 0.25f}, {0.45f, 0.20f, 0.25f}, {0.35f, 0.35f, 0.35f}};
    static const float shares[PALETTE_SIZE] = {0.05f, 0.08f, 0.10f, 0.12f,
                                               0.15f, 0.20f, 0.0f,  0.30f};
    const float roughness = rough ? ROUGHNESS : 0.0f;
    const bool is_glass =
        surface == SURFACE_GLASS || (surface == SURFACE_PAPER && slot == PALETTE_SIZE - 2);
    if (is_glass)
        return glass(g);
    if (surface == SURFACE_TEXTURE)
        return checkered(g, colors[slot]);
    const int32_t base = diffuse(g, colour(colors[slot]));
    switch (surface) {
    case SURFACE_PAPER:
        return mixed(g, shares[slot], base, reflecting(g, roughness));
    case SURFACE_MIRROR:
        return mixed(g, REFLECTING_SHARE, base, reflecting(g, 0.0f));
    case SURFACE_GLOSSY:
        return mixed(g, REFLECTING_SHARE, base, reflecting(g, ROUGHNESS));
    default:
        return base;
    }
}

trc_status palette_create(trc_scene scene, enum surface surface, bool rough,
                          trc_id materials_out[PALETTE_SIZE]) {
    trc_status status = TRC_OK;
    for (uint32_t slot = 0; slot < PALETTE_SIZE && status == TRC_OK; slot++) {
        struct graph g = {0};
        const int32_t output = surface_add(&g, surface, slot, rough);
        const trc_material_desc desc = {.struct_size = sizeof desc,
                                        .node_count = g.node_count,
                                        .nodes = g.nodes,
                                        .inputs = g.inputs,
                                        .input_count = g.input_count,
                                        .surface = output,
                                        .flags = TRC_MATERIAL_TRANSPARENT_SHADOW |
                                                 TRC_MATERIAL_DEFENSIVE_SAMPLING};
        status = trc_material_create(scene, &desc, &materials_out[slot]);
    }
    return status;
}
