/* Node lists: any types, modes, links, constants and tables, rendered where the library takes them.
 */
#include "bytes.h"
#include "stage.h"

#include "model/nodes.h"

#define MOST_NODES 16
#define MOST_INPUTS (MOST_NODES * TRC_MAX_NODE_INPUTS)
#define TABLE_FLOATS (4 * TRC_TABLE_ENTRIES)
#define TYPES 128

struct list {
    trc_node nodes[MOST_NODES];
    trc_node_input inputs[MOST_INPUTS];
    uint32_t node_count, input_count;
    float table[TABLE_FLOATS];
};

/* Mostly the right number of inputs, mostly linked to a node that is there. */
static void read_inputs(struct bytes *b, struct list *l, trc_node *node) {
    const struct trc_node_info *info = trc_node_info_of(node->type);
    node->first_input = l->input_count;
    node->input_count = info ? info->input_count : 0;
    if (bytes_below(b, 32) == 0)
        node->input_count = bytes_below(b, TRC_MAX_NODE_INPUTS);
    for (uint32_t i = 0; i < node->input_count; i++) {
        trc_node_input *in = &l->inputs[l->input_count++];
        in->node = (int32_t)bytes_below(b, 2 * l->node_count + 3) - 2;
        if (in->node >= (int32_t)l->node_count && bytes_below(b, 16))
            in->node = -1;
        in->output = bytes_below(b, 4);
        bytes_floats(b, in->value, 3);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static struct list l; /* large; one input runs at a time */
    struct bytes b = {data, size};
    memset(&l, 0, sizeof l);
    bytes_floats(&b, l.table, 8);
    const uint32_t count = bytes_below(&b, MOST_NODES + 1);
    for (; l.node_count < count; l.node_count++) {
        trc_node *node = &l.nodes[l.node_count];
        node->type = bytes_below(&b, TYPES);
        node->mode = bytes_byte(&b);
        if (bytes_below(&b, 4) == 0)
            node->mode |= (uint32_t)bytes_byte(&b) << 8;
        node->name = bytes_below(&b, 2) ? "UV" : NULL;
        if (trc_node_has_table(node->type)) {
            node->table = l.table;
            node->table_count = TABLE_FLOATS;
        }
        read_inputs(&b, &l, node);
    }
    const trc_material_desc desc = {.struct_size = sizeof desc,
                                    .node_count = l.node_count,
                                    .nodes = l.nodes,
                                    .inputs = l.inputs,
                                    .input_count = l.input_count,
                                    .surface = (int32_t)bytes_below(&b, MOST_NODES + 1) - 1,
                                    .flags = bytes_below(&b, 2 * TRC_MATERIAL_LIGHT_TREE)};
    const trc_scene scene = stage_scene();
    trc_id material = 0;
    stage_camera(scene);
    stage_light(scene);
    const trc_status status = trc_material_create(scene, &desc, &material);
    stage_quad(scene, status == TRC_OK ? material : 0);
    const trc_world_desc world = {.struct_size = sizeof world,
                                  .material = material,
                                  .visibility = TRC_VISIBLE_ALL,
                                  .ao_distance = 1.0f,
                                  .ao_factor = bytes_below(&b, 2) ? 1.0f : 0.0f};
    (void)trc_scene_set_world(scene, &world);
    const trc_render_desc render = stage_render();
    stage_run(scene, &render);
    (void)trc_scene_destroy(scene);
    return 0;
}
