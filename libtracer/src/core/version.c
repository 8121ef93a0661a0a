/* What a binding checks before anything else: versions and sizes of descriptors. */
#include <string.h>

#include "tracer/tracer.h"

#define TEXT_(x) #x
#define TEXT(x) TEXT_(x)

uint32_t trc_abi_version(void) { return TRC_ABI_VERSION; }

const char *trc_version_string(void) {
    return TEXT(TRC_VERSION_MAJOR) "." TEXT(TRC_VERSION_MINOR) "." TEXT(TRC_VERSION_PATCH);
}

uint32_t trc_struct_size(const char *name) {
#define ENTRY(type) \
    { #type, sizeof(type) }
    static const struct {
        const char *name;
        uint32_t size;
    } entries[] = {
        ENTRY(trc_corner_attribute),
        ENTRY(trc_mesh_desc),
        ENTRY(trc_instance_desc),
        ENTRY(trc_camera_desc),
        ENTRY(trc_light_desc),
        ENTRY(trc_world_desc),
        ENTRY(trc_node_input),
        ENTRY(trc_node),
        ENTRY(trc_material_desc),
        ENTRY(trc_image_desc),
        ENTRY(trc_rays),
        ENTRY(trc_hits),
        ENTRY(trc_render_desc),
        ENTRY(trc_render_progress),
        ENTRY(trc_scene_desc),
        ENTRY(trc_scene_stats),
        ENTRY(trc_reader_desc),
    };
#undef ENTRY
    if (!name)
        return 0;
    for (size_t i = 0; i < sizeof entries / sizeof *entries; i++) {
        if (strcmp(entries[i].name, name) == 0)
            return entries[i].size;
    }
    return 0;
}
