/* Edits of materials and images. */
#include "core/checks.h"
#include "core/core.h"
#include "image/image.h"
#include "image/prefetch.h"
#include "scene/scene.h"
#include "shading/compile.h"

static uint32_t image_index(const void *images, trc_id image) {
    return trc_store_get(images, image) ? trc_store_slot_of(image) : UINT32_MAX;
}

static bool image_has_levels(const void *images, trc_id image) {
    const struct trc_image *found = trc_store_get(images, image);
    return found && (found->level_count ? found->level_count > 1 : found->will_have_levels);
}

static trc_status compile(const struct trc_scene_state *scene, const trc_material_desc *desc,
                          struct trc_material **material_out) {
    const struct trc_compile_context context = {scene->names, image_index, image_has_levels,
                                                &scene->images};
    return trc_material_compile(desc, &context, material_out);
}

trc_status trc_scene_add_material(struct trc_scene_state *scene, const trc_material_desc *desc,
                                  trc_id *id) {
    struct trc_material *material;
    TRC_TRY(compile(scene, desc, &material));
    const trc_status status = trc_store_add(&scene->materials, material, id);
    if (status != TRC_OK) {
        trc_material_release(material);
        return status;
    }
    scene->changed |= TRC_CHANGED_MATERIALS;
    return TRC_OK;
}

trc_status trc_scene_change_material(struct trc_scene_state *scene, trc_id id,
                                     const trc_material_desc *desc) {
    void *former;
    TRC_TRY(trc_store_find(&scene->materials, id, &former));
    struct trc_material *material;
    TRC_TRY(compile(scene, desc, &material));
    scene->materials.slots[trc_store_slot_of(id)].object = material;
    trc_material_release(former);
    scene->changed |= TRC_CHANGED_MATERIALS;
    return TRC_OK;
}

trc_status trc_scene_remove_material(struct trc_scene_state *scene, trc_id id) {
    void *material;
    TRC_TRY(trc_store_find(&scene->materials, id, &material));
    trc_store_remove(&scene->materials, id);
    trc_material_release(material);
    /* Instances resolve to the default now, and the slot may get another material. */
    scene->changed |= TRC_CHANGED_MATERIALS | TRC_CHANGED_INSTANCES | TRC_CHANGED_WORLD;
    return TRC_OK;
}

uint32_t trc_scene_material_index(const struct trc_scene_state *scene, trc_id id) {
    return trc_store_get(&scene->materials, id) ? trc_store_slot_of(id) + 1 : 0;
}

/* Blender's grey diffuse for objects without a material; in mattes it has Cycles' name. */
trc_status trc_scene_make_default_material(struct trc_scene_state *scene) {
    const trc_node_input inputs[3] = {
        {.node = -1, .value = {0.8f, 0.8f, 0.8f}}, {.node = -1}, {.node = -2}};
    const trc_node node = {.type = TRC_NODE_DIFFUSE, .input_count = 3};
    const trc_material_desc desc = {.struct_size = sizeof desc,
                                    .node_count = 1,
                                    .nodes = &node,
                                    .inputs = inputs,
                                    .input_count = 3,
                                    .cryptomatte = trc_cryptomatte_id("default_surface")};
    return compile(scene, &desc, &scene->default_material);
}

/* The image of a slot, as it will be: halved ones replace those that are there at the end. */
static struct trc_image *fitted(const struct trc_store *images, struct trc_image *const *halves,
                                uint32_t slot) {
    return halves[slot] ? halves[slot] : images->slots[slot].object;
}

/* The slot of the largest image that can be halved, TRC_STORE_END if none can; what all take. */
static uint32_t find_largest(const struct trc_store *images, struct trc_image *const *halves,
                             uint64_t *bytes_out) {
    uint32_t largest = TRC_STORE_END;
    uint64_t bytes = 0, largest_bytes = 0;
    for (uint32_t i = trc_store_first(images); i != TRC_STORE_END; i = trc_store_next(images, i)) {
        const struct trc_image *image = fitted(images, halves, i);
        bytes += trc_image_bytes(image);
        if (trc_image_can_halve(image) && trc_image_bytes(image) > largest_bytes) {
            largest = i;
            largest_bytes = trc_image_bytes(image);
        }
    }
    *bytes_out = bytes;
    return largest;
}

/* Halves the largest images until all fit, or none can be halved any more, into halves by slot. */
static trc_status halve_images(const struct trc_store *images, uint64_t bytes_max,
                               struct trc_image **halves) {
    for (;;) {
        uint64_t bytes;
        const uint32_t largest = find_largest(images, halves, &bytes);
        if (bytes <= bytes_max || largest == TRC_STORE_END)
            return TRC_OK;
        struct trc_image *half;
        TRC_TRY(trc_image_halve(fitted(images, halves, largest), &half));
        trc_image_release(halves[largest]);
        halves[largest] = half;
    }
}

/* Makes all images fit, or leaves all as they are. */
static trc_status fit_images(struct trc_scene_state *scene) {
    struct trc_store *images = &scene->images;
    if (!scene->image_bytes_max)
        return TRC_OK;
    struct trc_image **halves = trc_alloc_zeroed(images->slot_count, sizeof *halves);
    if (!halves)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for smaller images");
    const trc_status status = halve_images(images, scene->image_bytes_max, halves);
    for (uint32_t i = 0; i < images->slot_count; i++) {
        if (halves[i] && status == TRC_OK) {
            trc_image_release(images->slots[i].object);
            images->slots[i].object = halves[i];
        } else {
            trc_image_release(halves[i]);
        }
    }
    trc_free(halves);
    return status;
}

void trc_scene_expect_image(struct trc_scene_state *scene, const trc_image_desc *desc) {
    if (!scene->prefetch &&
        trc_prefetch_create(scene->reader, scene->image_bytes_max, &scene->prefetch) != TRC_OK)
        return;
    trc_prefetch_add(scene->prefetch, desc);
}

/* An image that has been read ahead, or is read now. */
static trc_status get_image(const struct trc_scene_state *scene, const trc_image_desc *desc,
                            struct trc_image **image_out) {
    const struct trc_image_source source = {.reader = scene->reader};
    trc_status status;
    if (desc->path && scene->prefetch &&
        trc_prefetch_take(scene->prefetch, desc, &status, image_out))
        return status;
    return trc_image_load(desc, &source, image_out);
}

trc_status trc_scene_add_image(struct trc_scene_state *scene, const trc_image_desc *desc,
                               trc_id *id) {
    struct trc_image *image;
    TRC_TRY(get_image(scene, desc, &image));
    trc_id added;
    const trc_status status = trc_store_add(&scene->images, image, &added);
    if (status != TRC_OK) {
        trc_image_release(image);
        return status;
    }
    const trc_status fit = fit_images(scene);
    if (fit != TRC_OK) {
        trc_store_take_back(&scene->images, added);
        trc_image_release(image);
        return fit;
    }
    scene->changed |= TRC_CHANGED_IMAGES;
    *id = added;
    return TRC_OK;
}

trc_status trc_scene_change_image(struct trc_scene_state *scene, trc_id id,
                                  const trc_image_desc *desc) {
    void *former;
    TRC_TRY(trc_store_find(&scene->images, id, &former));
    struct trc_image *image;
    TRC_TRY(get_image(scene, desc, &image));
    void **object = &scene->images.slots[trc_store_slot_of(id)].object;
    *object = image;
    const trc_status fit = fit_images(scene);
    if (fit != TRC_OK) {
        *object = former;
        trc_image_release(image);
        return fit;
    }
    trc_image_release(former);
    scene->changed |= TRC_CHANGED_IMAGES;
    return TRC_OK;
}

trc_status trc_scene_remove_image(struct trc_scene_state *scene, trc_id id) {
    void *image;
    TRC_TRY(trc_store_find(&scene->images, id, &image));
    trc_store_remove(&scene->images, id);
    trc_image_release(image);
    scene->changed |= TRC_CHANGED_IMAGES;
    return TRC_OK;
}
