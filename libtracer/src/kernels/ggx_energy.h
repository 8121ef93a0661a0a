/* Energy that single scattering on a GGX surface keeps, for the two models that put the rest back.
 *
 * Tables are integrals of the models in microfacet.h over 400 x 400 (reflection) or 150 x 150
 * (glass) visible normals; tests/kernels/wide/test_bsdf.c checks them through the white furnace.
 * Rows go by sqrt(alpha), columns by sqrt(cos theta_o), both from 0 to 1 in equal steps; glass
 * tables go by (ior - 1) / (ior + 1) from -1/2 to 1/2. Interpolation is linear; it is off by at
 * most 0.013, except below cos = 0.002, where it may be 0.04.
 *
 * Model of the missing energy: C. Kulla and A. Conty, "Revisiting Physically Based Shading at
 * Imageworks" (2017). */
#ifndef TRACER_KERNELS_GGX_ENERGY_H
#define TRACER_KERNELS_GGX_ENERGY_H

#include "kernels/wide_math.h"

#define TRC_GGX_ENERGY_SIZE 16
#define TRC_GLASS_ENERGY_SIZE 8

/* clang-format off */
/* Albedo of reflection with height-correlated masking, no Fresnel factor. */
static const float trc_ggx_energy[TRC_GGX_ENERGY_SIZE * TRC_GGX_ENERGY_SIZE] = {
    0.8921f, 0.9999f, 1.0000f, 1.0000f, 1.0000f, 1.0000f, 1.0000f, 1.0000f,
    1.0000f, 1.0000f, 1.0000f, 1.0000f, 1.0000f, 1.0000f, 1.0000f, 1.0000f,
    0.9953f, 0.8921f, 0.9645f, 0.9927f, 0.9978f, 0.9992f, 0.9996f, 0.9999f,
    0.9999f, 1.0000f, 1.0000f, 1.0000f, 1.0000f, 1.0000f, 1.0000f, 1.0000f,
    0.9988f, 0.9525f, 0.8920f, 0.9221f, 0.9645f, 0.9846f, 0.9927f, 0.9962f,
    0.9978f, 0.9986f, 0.9992f, 0.9994f, 0.9996f, 0.9999f, 1.0000f, 1.0000f,
    0.9995f, 0.9772f, 0.9245f, 0.8912f, 0.9052f, 0.9380f, 0.9640f, 0.9794f,
    0.9878f, 0.9924f, 0.9950f, 0.9965f, 0.9974f, 0.9979f, 0.9982f, 0.9975f,
    0.9997f, 0.9863f, 0.9498f, 0.9089f, 0.8877f, 0.8948f, 0.9179f, 0.9422f,
    0.9609f, 0.9735f, 0.9816f, 0.9867f, 0.9900f, 0.9921f, 0.9934f, 0.9946f,
    0.9998f, 0.9900f, 0.9630f, 0.9282f, 0.8970f, 0.8816f, 0.8849f, 0.9010f,
    0.9213f, 0.9401f, 0.9550f, 0.9659f, 0.9736f, 0.9790f, 0.9827f, 0.9854f,
    0.9998f, 0.9913f, 0.9692f, 0.9393f, 0.9080f, 0.8829f, 0.8703f, 0.8714f,
    0.8828f, 0.8994f, 0.9167f, 0.9322f, 0.9449f, 0.9547f, 0.9622f, 0.9678f,
    0.9998f, 0.9913f, 0.9708f, 0.9435f, 0.9132f, 0.8851f, 0.8637f, 0.8523f,
    0.8515f, 0.8592f, 0.8723f, 0.8876f, 0.9027f, 0.9163f, 0.9278f, 0.9372f,
    0.9998f, 0.9903f, 0.9700f, 0.9428f, 0.9124f, 0.8825f, 0.8563f, 0.8366f,
    0.8253f, 0.8225f, 0.8270f, 0.8368f, 0.8497f, 0.8637f, 0.8774f, 0.8900f,
    0.9997f, 0.9894f, 0.9671f, 0.9383f, 0.9064f, 0.8743f, 0.8444f, 0.8189f,
    0.7995f, 0.7872f, 0.7821f, 0.7833f, 0.7896f, 0.7996f, 0.8116f, 0.8245f,
    0.9997f, 0.9879f, 0.9628f, 0.9310f, 0.8962f, 0.8608f, 0.8271f, 0.7966f,
    0.7707f, 0.7504f, 0.7361f, 0.7280f, 0.7255f, 0.7278f, 0.7340f, 0.7430f,
    0.9996f, 0.9861f, 0.9574f, 0.9216f, 0.8826f, 0.8430f, 0.8047f, 0.7692f,
    0.7374f, 0.7101f, 0.6879f, 0.6708f, 0.6590f, 0.6520f, 0.6495f, 0.6508f,
    0.9996f, 0.9839f, 0.9510f, 0.9104f, 0.8663f, 0.8216f, 0.7782f, 0.7373f,
    0.6998f, 0.6662f, 0.6368f, 0.6120f, 0.5915f, 0.5754f, 0.5634f, 0.5552f,
    0.9995f, 0.9814f, 0.9440f, 0.8979f, 0.8480f, 0.7976f, 0.7485f, 0.7019f,
    0.6587f, 0.6192f, 0.5837f, 0.5521f, 0.5244f, 0.5005f, 0.4801f, 0.4631f,
    0.9994f, 0.9786f, 0.9363f, 0.8842f, 0.8282f, 0.7716f, 0.7165f, 0.6642f,
    0.6154f, 0.5706f, 0.5296f, 0.4926f, 0.4593f, 0.4295f, 0.4030f, 0.3794f,
    0.9993f, 0.9759f, 0.9281f, 0.8697f, 0.8071f, 0.7442f, 0.6830f, 0.6251f,
    0.5712f, 0.5215f, 0.4762f, 0.4350f, 0.3978f, 0.3642f, 0.3340f, 0.3069f,
};
/* Its mean over the cosine-weighted hemisphere, by sqrt(alpha). */
static const float trc_ggx_energy_mean[TRC_GGX_ENERGY_SIZE] = {
    1.00000f, 0.99992f, 0.99901f, 0.99557f, 0.98688f, 0.96657f, 0.94068f, 0.90391f,
    0.85803f, 0.80293f, 0.74058f, 0.67342f, 0.60421f, 0.53565f, 0.47006f, 0.40913f,
};
/* Albedo of reflection and refraction together, separable masking, Fresnel by micro-normal. */
#define TRC_GLASS_ENERGY_COUNT 512
static const float trc_glass_energy[TRC_GLASS_ENERGY_COUNT] = {
    0.994f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f,
    0.930f, 0.881f, 0.964f, 0.993f, 0.998f, 1.000f, 1.000f, 1.000f,
    0.925f, 0.903f, 0.873f, 0.912f, 0.957f, 0.979f, 0.987f, 0.993f,
    0.902f, 0.891f, 0.864f, 0.849f, 0.870f, 0.906f, 0.934f, 0.956f,
    0.857f, 0.848f, 0.827f, 0.802f, 0.788f, 0.793f, 0.815f, 0.853f,
    0.785f, 0.776f, 0.754f, 0.726f, 0.696f, 0.667f, 0.656f, 0.674f,
    0.690f, 0.679f, 0.652f, 0.620f, 0.583f, 0.533f, 0.493f, 0.472f,
    0.581f, 0.569f, 0.537f, 0.501f, 0.462f, 0.404f, 0.349f, 0.303f,
    0.994f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f,
    0.927f, 0.880f, 0.964f, 0.993f, 0.998f, 1.000f, 1.000f, 1.000f,
    0.915f, 0.896f, 0.869f, 0.911f, 0.957f, 0.979f, 0.986f, 0.993f,
    0.881f, 0.872f, 0.850f, 0.841f, 0.866f, 0.903f, 0.928f, 0.958f,
    0.824f, 0.816f, 0.799f, 0.783f, 0.776f, 0.785f, 0.805f, 0.859f,
    0.740f, 0.731f, 0.712f, 0.692f, 0.676f, 0.658f, 0.651f, 0.686f,
    0.635f, 0.625f, 0.599f, 0.576f, 0.558f, 0.532f, 0.501f, 0.487f,
    0.521f, 0.509f, 0.479f, 0.454f, 0.442f, 0.420f, 0.371f, 0.318f,
    0.994f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f,
    0.922f, 0.877f, 0.962f, 0.993f, 0.998f, 0.999f, 0.999f, 1.000f,
    0.893f, 0.878f, 0.860f, 0.907f, 0.955f, 0.976f, 0.980f, 0.993f,
    0.834f, 0.829f, 0.817f, 0.820f, 0.852f, 0.892f, 0.920f, 0.961f,
    0.746f, 0.741f, 0.733f, 0.732f, 0.741f, 0.764f, 0.807f, 0.878f,
    0.634f, 0.627f, 0.614f, 0.611f, 0.620f, 0.641f, 0.675f, 0.735f,
    0.511f, 0.501f, 0.483f, 0.479f, 0.500f, 0.537f, 0.555f, 0.562f,
    0.392f, 0.381f, 0.361f, 0.361f, 0.397f, 0.453f, 0.457f, 0.400f,
    0.994f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f,
    0.904f, 0.869f, 0.959f, 0.991f, 0.997f, 0.997f, 1.000f, 1.000f,
    0.821f, 0.818f, 0.828f, 0.889f, 0.940f, 0.964f, 0.991f, 1.000f,
    0.682f, 0.684f, 0.703f, 0.741f, 0.795f, 0.877f, 0.954f, 0.986f,
    0.513f, 0.512f, 0.528f, 0.577f, 0.654f, 0.767f, 0.882f, 0.961f,
    0.354f, 0.350f, 0.362f, 0.428f, 0.545f, 0.675f, 0.801f, 0.909f,
    0.231f, 0.226f, 0.240f, 0.321f, 0.457f, 0.600f, 0.730f, 0.827f,
    0.147f, 0.143f, 0.162f, 0.248f, 0.385f, 0.533f, 0.670f, 0.721f,
    0.994f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f,
    0.936f, 0.896f, 0.976f, 0.997f, 0.999f, 1.000f, 1.000f, 1.000f,
    0.917f, 0.915f, 0.918f, 0.962f, 0.988f, 0.996f, 0.999f, 1.000f,
    0.803f, 0.827f, 0.873f, 0.914f, 0.954f, 0.979f, 0.992f, 0.999f,
    0.602f, 0.639f, 0.729f, 0.820f, 0.892f, 0.943f, 0.977f, 0.996f,
    0.404f, 0.442f, 0.544f, 0.671f, 0.788f, 0.881f, 0.947f, 0.989f,
    0.260f, 0.292f, 0.387f, 0.519f, 0.660f, 0.791f, 0.899f, 0.977f,
    0.167f, 0.194f, 0.275f, 0.395f, 0.537f, 0.687f, 0.833f, 0.959f,
    0.994f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f,
    0.936f, 0.892f, 0.973f, 0.996f, 0.999f, 1.000f, 1.000f, 1.000f,
    0.935f, 0.923f, 0.912f, 0.955f, 0.985f, 0.995f, 0.998f, 1.000f,
    0.891f, 0.895f, 0.903f, 0.920f, 0.951f, 0.976f, 0.990f, 0.996f,
    0.780f, 0.794f, 0.829f, 0.867f, 0.905f, 0.941f, 0.968f, 0.985f,
    0.621f, 0.639f, 0.690f, 0.756f, 0.822f, 0.881f, 0.930f, 0.965f,
    0.460f, 0.478f, 0.532f, 0.611f, 0.700f, 0.789f, 0.870f, 0.932f,
    0.327f, 0.344f, 0.394f, 0.471f, 0.568f, 0.676f, 0.787f, 0.886f,
    0.994f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f,
    0.936f, 0.892f, 0.973f, 0.996f, 0.999f, 1.000f, 1.000f, 1.000f,
    0.940f, 0.925f, 0.912f, 0.953f, 0.984f, 0.994f, 0.997f, 0.999f,
    0.912f, 0.912f, 0.910f, 0.920f, 0.948f, 0.973f, 0.986f, 0.992f,
    0.835f, 0.841f, 0.858f, 0.878f, 0.904f, 0.933f, 0.957f, 0.973f,
    0.707f, 0.718f, 0.746f, 0.785f, 0.827f, 0.869f, 0.907f, 0.936f,
    0.559f, 0.570f, 0.602f, 0.651f, 0.710f, 0.771f, 0.831f, 0.881f,
    0.421f, 0.431f, 0.462f, 0.511f, 0.575f, 0.650f, 0.732f, 0.811f,
    0.994f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f, 1.000f,
    0.937f, 0.894f, 0.974f, 0.996f, 0.999f, 1.000f, 1.000f, 1.000f,
    0.943f, 0.928f, 0.915f, 0.954f, 0.983f, 0.993f, 0.996f, 0.998f,
    0.924f, 0.921f, 0.914f, 0.921f, 0.945f, 0.968f, 0.981f, 0.988f,
    0.863f, 0.866f, 0.873f, 0.882f, 0.900f, 0.921f, 0.942f, 0.958f,
    0.757f, 0.762f, 0.777f, 0.798f, 0.823f, 0.850f, 0.876f, 0.900f,
    0.623f, 0.628f, 0.645f, 0.672f, 0.706f, 0.744f, 0.783f, 0.820f,
    0.487f, 0.492f, 0.508f, 0.534f, 0.570f, 0.615f, 0.669f, 0.728f,
};
/* clang-format on */

/* Cell and fraction of x in [0, 1] on a grid of size points. */
TRC_INLINE vint trc_grid_cell(vfloat x, int size, vfloat *fraction) {
    const vfloat scaled = vf_saturate(x) * vf_set((float)(size - 1));
    const vfloat cell = vf_min(vf_floor(scaled), vf_set((float)(size - 2)));
    *fraction = scaled - cell;
    return vf_to_int(cell);
}
TRC_INLINE vfloat trc_grid_row(const float *table, vint at, vfloat x) {
    const vmask all = vm_all_set();
    return vf_lerp(vf_gather(table, at, all), vf_gather(table + 1, at, all), x);
}
TRC_INLINE vfloat trc_ggx_albedo(vfloat cos_theta, vfloat alpha) {
    vfloat x, y;
    const vint column = trc_grid_cell(vf_safe_sqrt(cos_theta), TRC_GGX_ENERGY_SIZE, &x);
    const vint row = trc_grid_cell(vf_safe_sqrt(alpha), TRC_GGX_ENERGY_SIZE, &y);
    const vint at = row * vi_set(TRC_GGX_ENERGY_SIZE) + column;
    return vf_lerp(trc_grid_row(trc_ggx_energy, at, x),
                   trc_grid_row(trc_ggx_energy + TRC_GGX_ENERGY_SIZE, at, x), y);
}
TRC_INLINE vfloat trc_ggx_mean_albedo(vfloat alpha) {
    vfloat y;
    const vint row = trc_grid_cell(vf_safe_sqrt(alpha), TRC_GGX_ENERGY_SIZE, &y);
    return trc_grid_row(trc_ggx_energy_mean, row, y);
}
TRC_INLINE vfloat trc_glass_albedo(vfloat cos_theta, vfloat alpha, vfloat ior) {
    vfloat x, y, z;
    const int size = TRC_GLASS_ENERGY_SIZE;
    const vint column = trc_grid_cell(vf_safe_sqrt(cos_theta), size, &x);
    const vint row = trc_grid_cell(vf_safe_sqrt(alpha), size, &y);
    const vint slice = trc_grid_cell((ior - vf_one()) / (ior + vf_one()) + vf_set(0.5f), size, &z);
    const vint at = (slice * vi_set(size) + row) * vi_set(size) + column;
    const float *table = trc_glass_energy, *next = trc_glass_energy + size * size;
    return vf_lerp(vf_lerp(trc_grid_row(table, at, x), trc_grid_row(table + size, at, x), y),
                   vf_lerp(trc_grid_row(next, at, x), trc_grid_row(next + size, at, x), y), z);
}

#endif
