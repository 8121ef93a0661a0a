/* This instruction set's entry in the dispatch (model/kernels.c). */
#include "model/kernels.h"

#include "kernels/filter/filter.h"
#include "kernels/light/lamp_shade.h"
#include "kernels/light/world.h"
#include "kernels/program/program.h"
#include "kernels/tile/tile.h"
#include "kernels/trace/query.h"
#include "kernels/trace/split.h"

#define TRC_ISA_NUMBER_scalar TRC_ISA_SCALAR
#define TRC_ISA_NUMBER_sse42 TRC_ISA_SSE42
#define TRC_ISA_NUMBER_avx2 TRC_ISA_AVX2
#define TRC_ISA_NUMBER_avx512 TRC_ISA_AVX512
#define TRC_ISA_NUMBER_neon TRC_ISA_NEON
#define TRC_ISA_NUMBER_(isa) TRC_ISA_NUMBER_##isa
#define TRC_ISA_NUMBER(isa) TRC_ISA_NUMBER_(isa)

extern const struct trc_kernels TRC_KERNEL(trc_kernels);
const struct trc_kernels TRC_KERNEL(trc_kernels) = {
    .isa = TRC_ISA_NUMBER(TRC_ISA),
    .width = TRC_WIDTH,
    .tile_memory_bytes = TRC_KERNEL(trc_tile_memory_bytes),
    .tile_render = TRC_KERNEL(trc_tile_render),
    .denoise_memory_bytes = TRC_KERNEL(trc_denoise_memory_bytes),
    .denoise_tile = TRC_KERNEL(trc_denoise_tile),
    .preview_load = TRC_KERNEL(trc_preview_load),
    .preview_filter = TRC_KERNEL(trc_preview_filter),
    .preview_store = TRC_KERNEL(trc_preview_store),
    .query_closest = TRC_KERNEL(trc_query_closest_rays),
    .query_occluded = TRC_KERNEL(trc_query_occluded_rays),
    .world_evaluate = TRC_KERNEL(trc_world_evaluate),
    .lamp_measure = TRC_KERNEL(trc_lamp_measure),
#if TRC_WIDTH == 1
    .program_fold = TRC_KERNEL(trc_program_fold),
    .displace = TRC_KERNEL(trc_program_displace),
#endif
    .split_find = TRC_KERNEL(trc_split_find),
    .split_apply = TRC_KERNEL(trc_split_apply),
};
