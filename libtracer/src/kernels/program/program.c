/* Runs material programs on TRC_WIDTH shading points, and single operations on constants. */
#include "kernels/program/program.h"

#include <string.h>

#include "kernels/program/color.h"
#include "kernels/program/input.h"
#include "kernels/program/math.h"
#include "kernels/program/normal.h"
#include "kernels/program/point.h"
#include "kernels/program/procedural.h"
#include "kernels/program/relief.h"
#include "kernels/program/table.h"
#include "kernels/program/texture.h"
#include "kernels/program/tracing.h"
#include "kernels/trace/curve_surface.h"

/* Operations that depend on inputs alone. Long because it is the list of them; true if op is one.
 */
static bool run_pure(uint32_t op, uint32_t mode, const float *table, const vfloat *in,
                     vfloat *out) {
    switch (op) {
    case TRC_OP_MATH:
        out[0] =
            op_math(mode, in[TRC_OP_AT(MATH, a)], in[TRC_OP_AT(MATH, b)], in[TRC_OP_AT(MATH, c)]);
        return true;
    case TRC_OP_CLAMP:
        out[0] = op_clamp(mode, in[TRC_OP_AT(CLAMP, value)], in[TRC_OP_AT(CLAMP, min)],
                          in[TRC_OP_AT(CLAMP, max)]);
        return true;
    case TRC_OP_MAP_RANGE:
        out[0] = op_map_range(in);
        return true;
    case TRC_OP_VECTOR_MATH:
        v3_write(out, op_vector_math(mode, v3_read(in + TRC_OP_AT(VECTOR_MATH, a)),
                                     v3_read(in + TRC_OP_AT(VECTOR_MATH, b)),
                                     v3_read(in + TRC_OP_AT(VECTOR_MATH, c)),
                                     in[TRC_OP_AT(VECTOR_MATH, scale)]));
        return true;
    case TRC_OP_VECTOR_MEASURE:
        out[0] = op_vector_measure(mode, v3_read(in + TRC_OP_AT(VECTOR_MEASURE, a)),
                                   v3_read(in + TRC_OP_AT(VECTOR_MEASURE, b)));
        return true;
    case TRC_OP_ROTATION:
        op_rotation(v3_read(in), out);
        return true;
    case TRC_OP_AXIS_ROTATION:
        op_axis_rotation(v3_read(in + TRC_OP_AT(AXIS_ROTATION, axis)),
                         in[TRC_OP_AT(AXIS_ROTATION, angle)], out);
        return true;
    case TRC_OP_CURVE:
        out[0] = op_curve(mode, table, in);
        return true;
    case TRC_OP_BLACKBODY:
        v3_write(out, op_blackbody(mode, in[0]));
        return true;
    case TRC_OP_WAVELENGTH:
        v3_write(out, op_wavelength(mode, in[0]));
        return true;
    case TRC_OP_MAPPING:
        v3_write(out, op_mapping(mode, in));
        return true;
    case TRC_OP_MIX:
        v3_write(out, op_mix(mode, in[TRC_OP_AT(MIX, factor)], v3_read(in + TRC_OP_AT(MIX, a)),
                             v3_read(in + TRC_OP_AT(MIX, b))));
        return true;
    case TRC_OP_SATURATE:
        v3_write(out, v3_saturate(v3_read(in)));
        return true;
    case TRC_OP_LUMINANCE:
        out[0] = v3_luminance(v3_read(in));
        return true;
    case TRC_OP_AVERAGE:
        out[0] = v3_average(v3_read(in));
        return true;
    case TRC_OP_INVERT:
        v3_write(out,
                 op_invert(in[TRC_OP_AT(INVERT, factor)], v3_read(in + TRC_OP_AT(INVERT, color))));
        return true;
    case TRC_OP_GAMMA:
        v3_write(out, op_gamma(v3_read(in + TRC_OP_AT(GAMMA, color)), in[TRC_OP_AT(GAMMA, gamma)]));
        return true;
    case TRC_OP_HUE_SATURATION:
        v3_write(out, op_hue_saturation(in[TRC_OP_AT(HUE_SATURATION, hue)],
                                        in[TRC_OP_AT(HUE_SATURATION, saturation)],
                                        in[TRC_OP_AT(HUE_SATURATION, value)],
                                        in[TRC_OP_AT(HUE_SATURATION, factor)],
                                        v3_read(in + TRC_OP_AT(HUE_SATURATION, color))));
        return true;
    case TRC_OP_BRIGHT_CONTRAST:
        v3_write(out, op_bright_contrast(v3_read(in + TRC_OP_AT(BRIGHT_CONTRAST, color)),
                                         in[TRC_OP_AT(BRIGHT_CONTRAST, bright)],
                                         in[TRC_OP_AT(BRIGHT_CONTRAST, contrast)]));
        return true;
    case TRC_OP_RAMP:
        op_ramp(mode, table, in[0], out);
        return true;
    case TRC_OP_SEPARATE:
        v3_write(out, op_separate(mode, v3_read(in)));
        return true;
    case TRC_OP_COMBINE:
        v3_write(out, op_combine(mode, v3_read(in)));
        return true;
    case TRC_OP_PROJECT:
        op_project(mode, v3_read(in), out);
        return true;
    case TRC_OP_CHECKER:
        op_checker(in, out);
        return true;
    case TRC_OP_NOISE:
    case TRC_OP_VORONOI:
    case TRC_OP_WAVE:
    case TRC_OP_MAGIC:
    case TRC_OP_BRICK:
#define TRC_TEXTURE(NAME, number, label, inputs, outputs, modes) case TRC_OP_##NAME:
#include "tracer/nodes.def"
        trc_program_procedural(op, mode, in, out);
        return true;
    default:
        return false;
    }
}

/* 0 where nothing is met; what has no such attribute is opaque, as in Cycles. */
static void op_raycast_attribute(const struct trc_surface *s, const struct trc_instruction *i,
                                 const vfloat *in, vfloat *out) {
    struct trc_surface hit;
    if (trc_program_cast(s, i->mode, in, &hit))
        op_color_attribute(&hit, i->resource, vf_truth(hit.active), out);
    else
        memset(out, 0, TRC_OP_OUT_AT(RAYCAST_ATTRIBUTE, end) * sizeof *out);
}

/* Operations that read the shading point. Long because it is the list of them. */
static void run_at_surface(const struct trc_surface *s, const struct trc_instruction *i,
                           const vfloat *in, vfloat *out) {
    switch (i->op) {
    case TRC_OP_POSITION:
        v3_write(out, s->p);
        break;
    case TRC_OP_NORMAL:
        v3_write(out, s->n);
        break;
    case TRC_OP_TRUE_NORMAL:
        v3_write(out, trc_curve_true_normal(s));
        break;
    case TRC_OP_INCOMING:
        v3_write(out, s->wo);
        break;
    case TRC_OP_TANGENT:
        v3_write(out, op_tangent(s, i->mode, i->resource));
        break;
    case TRC_OP_DEFAULT_TANGENT:
        v3_write(out, op_default_tangent(s));
        break;
    case TRC_OP_PARAMETRIC:
        out[TRC_OP_OUT_AT(PARAMETRIC, u)] = vf_one() - s->u - s->v;
        out[TRC_OP_OUT_AT(PARAMETRIC, v)] = s->u;
        break;
    case TRC_OP_BACKFACING:
        out[0] = vf_truth(s->backfacing);
        break;
    case TRC_OP_GENERATED:
        v3_write(out, op_generated(s));
        break;
    case TRC_OP_OBJECT_NORMAL:
        v3_write(out, op_object_normal(s));
        break;
    case TRC_OP_OBJECT_POSITION:
        v3_write(out, op_object_position(s));
        break;
    case TRC_OP_CAMERA_POSITION:
        v3_write(out, op_camera_position(s, i->mode));
        break;
    case TRC_OP_WINDOW:
        op_window(s, out);
        break;
    case TRC_OP_REFLECTION:
        v3_write(out, op_reflection(s));
        break;
    case TRC_OP_UV:
        op_uv(s, i->resource, out);
        break;
    case TRC_OP_UV_DENSITY:
        out[0] = op_uv_density(s, i->resource);
        break;
    case TRC_OP_COLOR_ATTRIBUTE:
        op_color_attribute(s, i->resource, vf_zero(), out);
        break;
    case TRC_OP_LIGHT_PATH:
        out[0] = op_light_path(s, i->mode);
        break;
    case TRC_OP_OBJECT_LOCATION:
        v3_write(out, op_object_location(s));
        break;
    case TRC_OP_OBJECT_COLOR:
        for (int c = 0; c < OBJECT_INDEX; c++)
            out[c] = object_number(s, c);
        break;
    case TRC_OP_OBJECT_INDEX:
        out[0] = object_number(s, OBJECT_INDEX);
        break;
    case TRC_OP_OBJECT_RANDOM:
        out[0] = object_number(s, OBJECT_RANDOM);
        break;
    case TRC_OP_INSTANCE_VALUES:
        op_instance_values(s, i->mode, out);
        break;
    case TRC_OP_POINT_INFO:
        op_point_info(s, out);
        break;
    case TRC_OP_FRESNEL:
        out[0] =
            op_fresnel(s, in[TRC_OP_AT(FRESNEL, ior)], v3_read(in + TRC_OP_AT(FRESNEL, normal)));
        break;
    case TRC_OP_LAYER_FRESNEL:
        out[0] = op_layer_fresnel(s, in[TRC_OP_AT(LAYER_FRESNEL, blend)],
                                  v3_read(in + TRC_OP_AT(LAYER_FRESNEL, normal)));
        break;
    case TRC_OP_LAYER_FACING:
        out[0] = op_layer_facing(s, in[TRC_OP_AT(LAYER_FACING, blend)],
                                 v3_read(in + TRC_OP_AT(LAYER_FACING, normal)));
        break;
    case TRC_OP_NORMAL_MAP:
        v3_write(out, op_normal_map(s, i->mode, i->resource, in[TRC_OP_AT(NORMAL_MAP, strength)],
                                    v3_read(in + TRC_OP_AT(NORMAL_MAP, color))));
        break;
    case TRC_OP_TANGENT_VECTOR:
        v3_write(out, op_tangent_vector(s, i->resource, v3_read(in)));
        break;
    case TRC_OP_REST:
        op_rest(s, out);
        break;
    case TRC_OP_BUMP:
        v3_write(out, op_bump(s, i->mode, in));
        break;
    case TRC_OP_TRANSFORM:
        v3_write(out, op_transform(s, i->mode, v3_read(in)));
        break;
    case TRC_OP_AMBIENT_OCCLUSION:
    case TRC_OP_BEVEL:
    case TRC_OP_RAYCAST:
        trc_program_trace(s, i->op, i->mode, in, out);
        break;
    case TRC_OP_RAYCAST_ATTRIBUTE:
        op_raycast_attribute(s, i, in, out);
        break;
    case TRC_OP_WIREFRAME:
        out[0] = op_wireframe(s, i->mode, in[TRC_OP_AT(WIREFRAME, size)],
                              v3_read(in + TRC_OP_AT(WIREFRAME, position)));
        break;
    case TRC_OP_IMAGE:
        texture_lookup(image_of(s, i->resource), i->mode, in[TRC_OP_AT(IMAGE, u)],
                       in[TRC_OP_AT(IMAGE, v)], in[TRC_OP_AT(IMAGE, density)] * s->footprint,
                       s->active, out);
        break;
    case TRC_OP_IMAGE_BOX:
        op_image_box(s, image_of(s, i->resource), i->mode,
                     v3_read(in + TRC_OP_AT(IMAGE_BOX, vector)), in[TRC_OP_AT(IMAGE_BOX, blend)],
                     out);
        break;
    default:
        break;
    }
}

/* What an operation gives at a point beside. */
static void run_beside(const struct trc_surface *s, const struct trc_instruction *i,
                       const vfloat *in, vfloat *out) {
    struct trc_surface beside;
    point_beside(s, i->mode & TRC_BESIDE_Y, in[TRC_OP_AT(BESIDE, filter_width)], &beside);
    const uint32_t op = i->mode & ~TRC_BESIDE_Y;
    if (op == TRC_OP_OBJECT_NORMAL)
        normal_beside(&beside);
    const struct trc_instruction there = {.op = (uint16_t)op, .resource = i->resource};
    run_at_surface(&beside, &there, in, out);
}

void trc_program_run(const struct trc_material *m, struct trc_surface *s,
                     struct trc_registers *regs) {
    for (uint32_t k = 0; k < m->instruction_count; k++) {
        const struct trc_instruction *i = &m->instructions[k];
        const struct trc_operand *operands = &m->operands[i->first_input];
        vfloat in[TRC_OP_MAX_INPUTS]; /* copies: outputs may take the place of inputs */
        for (uint32_t n = 0; n < i->input_count; n++)
            in[n] = trc_operand_value(&operands[n], regs);
        vfloat *out = &regs->r[i->out];
        const float *table = trc_op_has_table(i->op) ? m->tables + i->resource : NULL;
        if (run_pure(i->op, i->mode, table, in, out))
            continue;
        if (i->op == TRC_OP_BESIDE) {
            run_beside(s, i, in, out);
        } else if (i->op == TRC_OP_SET_POSITION) {
            s->p = v3_select(s->active, v3_read(in), s->p);
            v3_write(out, s->p);
        } else if (i->op == TRC_OP_SET_NORMAL) {
            s->n = v3_select(s->active, v3_read(in), s->n);
            v3_write(out, s->n);
        } else {
            run_at_surface(s, i, in, out);
        }
    }
}

#if TRC_WIDTH == 1
void trc_program_fold(uint32_t op, uint32_t mode, const float *table, const float *in, float *out) {
    run_pure(op, mode, table, in, out);
}

/* A corner of a triangle in the middle of the shutter, shaded smoothly, that no ray has hit: it has
 * no footprint. */
static void corner_surface(const struct trc_displace_job *job, uint32_t corner,
                           const struct trc_wide_affine *to_world, struct trc_surface *s) {
    const struct trc_instance *instance = &job->snapshot->instances[job->instance];
    const struct trc_mesh *mesh = job->snapshot->meshes[instance->mesh];
    memset(s, 0, sizeof *s);
    s->snapshot = job->snapshot;
    s->active = vm_all_set();
    s->instance = vi_set((int32_t)job->instance);
    s->triangle = vi_set((int32_t)(corner / 3));
    s->u = vf_set(corner % 3 == 1 ? 1.0f : 0.0f);
    s->v = vf_set(corner % 3 == 2 ? 1.0f : 0.0f);
    s->time = vf_set(0.5f);
    trc_surface_fetch(s);
    const float *n = job->normals + 3 * (size_t)mesh->indices[corner];
    s->n = normal_to_world(to_world, v3(vf_set(n[0]), vf_set(n[1]), vf_set(n[2])));
}

void trc_program_displace(const struct trc_displace_job *job) {
    const struct trc_instance *instance = &job->snapshot->instances[job->instance];
    const struct trc_mesh *mesh = job->snapshot->meshes[instance->mesh];
    const struct trc_material *program = job->program;
    const struct trc_operand *moved_by = program->operands + program->aovs[0].first_operand;
    struct trc_wide_affine to_world, to_object;
    trc_load_affine(instance, vf_set(0.5f), &to_world);
    affine_inverse(&to_world, &to_object);
    for (uint32_t i = 0; i < job->count; i++) {
        struct trc_surface s;
        struct trc_registers regs;
        corner_surface(job, job->corners[i], &to_world, &s);
        trc_program_run(program, &s, &regs);
        const vvec3 offset = trc_transform_vector(&to_object, trc_operand_vec3(moved_by, &regs));
        const float out[3] = {vf_get(offset.x, 0), vf_get(offset.y, 0), vf_get(offset.z, 0)};
        for (int k = 0; k < 3; k++)
            job->offsets[3 * (size_t)mesh->indices[job->corners[i]] + (size_t)k] =
                isfinite(out[k]) ? out[k] : 0.0f;
    }
}
#endif
