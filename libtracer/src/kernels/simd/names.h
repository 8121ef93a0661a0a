/* Names of the functions that exist once per instruction set.
 *
 * Sources declare, define and call them by plain names; what the linker sees ends with the
 * instruction set. The macros take arguments, so that structures of the same name are left alone. A
 * new function with external linkage in kernels/ needs its line here, or the instruction sets would
 * define it several times, which the linker tells. */
#ifndef TRACER_KERNELS_SIMD_NAMES_H
#define TRACER_KERNELS_SIMD_NAMES_H

#define TRC_CONCAT_(a, b) a##_##b
#define TRC_CONCAT(a, b) TRC_CONCAT_(a, b)
/* The linker's name, for tables of pointers. */
#define TRC_KERNEL(name) TRC_CONCAT(name, TRC_ISA)

#define trc_bsdf_albedo(...) TRC_KERNEL(trc_bsdf_albedo)(__VA_ARGS__)
#define trc_bsdf_eval(...) TRC_KERNEL(trc_bsdf_eval)(__VA_ARGS__)
#define trc_bsdf_ideal(...) TRC_KERNEL(trc_bsdf_ideal)(__VA_ARGS__)
#define trc_bsdf_sample(...) TRC_KERNEL(trc_bsdf_sample)(__VA_ARGS__)
#define trc_bundle_closest(...) TRC_KERNEL(trc_bundle_closest)(__VA_ARGS__)
#define trc_bundle_occluded(...) TRC_KERNEL(trc_bundle_occluded)(__VA_ARGS__)
#define trc_camera_rays(...) TRC_KERNEL(trc_camera_rays)(__VA_ARGS__)
#define trc_catcher_split(...) TRC_KERNEL(trc_catcher_split)(__VA_ARGS__)
#define trc_clock_shade(...) TRC_KERNEL(trc_clock_shade)(__VA_ARGS__)
#define trc_clock_trace(...) TRC_KERNEL(trc_clock_trace)(__VA_ARGS__)
#define trc_data_passes(...) TRC_KERNEL(trc_data_passes)(__VA_ARGS__)
#define trc_hit_material(...) TRC_KERNEL(trc_hit_material)(__VA_ARGS__)
#define trc_light_chosen(...) TRC_KERNEL(trc_light_chosen)(__VA_ARGS__)
#define trc_light_group(...) TRC_KERNEL(trc_light_group)(__VA_ARGS__)
#define trc_light_hit(...) TRC_KERNEL(trc_light_hit)(__VA_ARGS__)
#define trc_light_hit_clamped(...) TRC_KERNEL(trc_light_hit_clamped)(__VA_ARGS__)
#define trc_light_prepare(...) TRC_KERNEL(trc_light_prepare)(__VA_ARGS__)
#define trc_light_sample(...) TRC_KERNEL(trc_light_sample)(__VA_ARGS__)
#define trc_light_sample_prepared(...) TRC_KERNEL(trc_light_sample_prepared)(__VA_ARGS__)
#define trc_light_sample_world(...) TRC_KERNEL(trc_light_sample_world)(__VA_ARGS__)
#define trc_light_triangle_weight(...) TRC_KERNEL(trc_light_triangle_weight)(__VA_ARGS__)
#define trc_light_visibility(...) TRC_KERNEL(trc_light_visibility)(__VA_ARGS__)
#define trc_lobes_diffuse(...) TRC_KERNEL(trc_lobes_diffuse)(__VA_ARGS__)
#define trc_lobes_emission(...) TRC_KERNEL(trc_lobes_emission)(__VA_ARGS__)
#define trc_lobes_features(...) TRC_KERNEL(trc_lobes_features)(__VA_ARGS__)
#define trc_lobes_setup(...) TRC_KERNEL(trc_lobes_setup)(__VA_ARGS__)
#define trc_lobes_transparency(...) TRC_KERNEL(trc_lobes_transparency)(__VA_ARGS__)
#define trc_oren_nayar_albedo(...) TRC_KERNEL(trc_oren_nayar_albedo)(__VA_ARGS__)
#define trc_program_fold(...) TRC_KERNEL(trc_program_fold)(__VA_ARGS__)
#define trc_program_procedural(...) TRC_KERNEL(trc_program_procedural)(__VA_ARGS__)
#define trc_program_run(...) TRC_KERNEL(trc_program_run)(__VA_ARGS__)
#define trc_query_closest_rays(...) TRC_KERNEL(trc_query_closest_rays)(__VA_ARGS__)
#define trc_query_normal(...) TRC_KERNEL(trc_query_normal)(__VA_ARGS__)
#define trc_query_occluded_rays(...) TRC_KERNEL(trc_query_occluded_rays)(__VA_ARGS__)
#define trc_sample(...) TRC_KERNEL(trc_sample)(__VA_ARGS__)
#define trc_samples(...) TRC_KERNEL(trc_samples)(__VA_ARGS__)
#define trc_shade_batch(...) TRC_KERNEL(trc_shade_batch)(__VA_ARGS__)
#define trc_shadow_flush(...) TRC_KERNEL(trc_shadow_flush)(__VA_ARGS__)
#define trc_split_apply(...) TRC_KERNEL(trc_split_apply)(__VA_ARGS__)
#define trc_split_find(...) TRC_KERNEL(trc_split_find)(__VA_ARGS__)
#define trc_surface_fetch(...) TRC_KERNEL(trc_surface_fetch)(__VA_ARGS__)
#define trc_tile_memory_bytes(...) TRC_KERNEL(trc_tile_memory_bytes)(__VA_ARGS__)
#define trc_tile_render(...) TRC_KERNEL(trc_tile_render)(__VA_ARGS__)
#define trc_tile_sort(...) TRC_KERNEL(trc_tile_sort)(__VA_ARGS__)
#define trc_trace_closest(...) TRC_KERNEL(trc_trace_closest)(__VA_ARGS__)
#define trc_trace_looking_back(...) TRC_KERNEL(trc_trace_looking_back)(__VA_ARGS__)
#define trc_trace_occluded(...) TRC_KERNEL(trc_trace_occluded)(__VA_ARGS__)
#define trc_world_aovs(...) TRC_KERNEL(trc_world_aovs)(__VA_ARGS__)
#define trc_world_evaluate(...) TRC_KERNEL(trc_world_evaluate)(__VA_ARGS__)
#define trc_world_radiance(...) TRC_KERNEL(trc_world_radiance)(__VA_ARGS__)
#define trc_world_run(...) TRC_KERNEL(trc_world_run)(__VA_ARGS__)
#define trc_world_shade(...) TRC_KERNEL(trc_world_shade)(__VA_ARGS__)

#endif
