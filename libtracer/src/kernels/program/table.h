/* Values read off tables: curves, the colours of glowing bodies and of wavelengths. */
#ifndef TRACER_KERNELS_PROGRAM_TABLE_H
#define TRACER_KERNELS_PROGRAM_TABLE_H

#include "kernels/program/values.h"
#include "model/program.h"

/* ---- curves ---- */

/* The table spans low to high; beyond, its ends go on straight or stay. */
static vfloat op_curve(uint32_t mode, const float *table, const vfloat *in) {
    const int32_t steps = TRC_TABLE_ENTRIES - 1;
    const float *channel = table + (mode & TRC_CURVE_CHANNEL_MASK);
    const vmask all = vm_all_set();
    const vfloat low = in[TRC_OP_AT(CURVE, low)], high = in[TRC_OP_AT(CURVE, high)];
    const vfloat x = (in[TRC_OP_AT(CURVE, value)] - low) / (high - low) * vf_set((float)steps);
    const vfloat inside = vf_clamp(x, 0.0f, (float)steps);
    const vint i = vf_to_int(inside), before_last = vi_set(steps - 1);
    const vint start = vi_select(vi_lt(i, before_last), i, before_last);
    const vfloat a = vf_gather(channel, start << 2, all);
    const vfloat b = vf_gather(channel + 4, start << 2, all);
    const vfloat t = (mode & TRC_CURVE_EXTRAPOLATE ? x : inside) - vi_to_float(start);
    return vf_lerp(a, b, t);
}

/* ---- blackbodies ---- */

/* Rec.709 colour of unit luminance of a blackbody, fitted to what Cycles shows: red and green are
 * a / T + b T + c, blue is a cubic in T, between these temperatures in kelvin. Below the first and
 * above the last the colour stays. What is negative is outside Rec.709. */
#define BLACKBODY_SEGMENTS 7
static const float blackbody_from[BLACKBODY_SEGMENTS] = {800.0f,  965.0f,  1167.0f, 1449.0f,
                                                         1902.0f, 3315.0f, 6365.0f};
static const float blackbody_red[BLACKBODY_SEGMENTS][3] = {
    {1619.18935f, -0.00205011157f, 5.02996177f},  {2488.45507f, -0.00111330872f, 3.22621456f},
    {3341.43233f, -0.000486550855f, 1.76486688f}, {4094.62142f, -0.000127445045f, 0.725726668f},
    {4670.28082f, 2.91258275e-05f, 0.126703228f}, {4595.09164f, 2.87495589e-05f, 0.150345088f},
    {3787.17457f, 9.35907693e-06f, 0.399075872f},
};
static const float blackbody_green[BLACKBODY_SEGMENTS][3] = {
    {-488.999748f, 0.000604330754f, -0.0755807526f}, {-755.994038f, 0.000316730356f, 0.478305649f},
    {-1023.63811f, 0.000120224472f, 0.936659733f},   {-1265.71414f, 4.87301195e-06f, 1.27054627f},
    {-1425.29364f, -4.01150958e-05f, 1.43972804f},   {-1175.54839f, -2.16378154e-05f, 1.30408033f},
    {-500.799272f, -4.59831513e-06f, 1.09098761f},
};
static const float blackbody_blue[BLACKBODY_SEGMENTS][4] = {
    {5.96945309e-11f, -4.85742887e-08f, -9.70622247e-05f, -0.00407936148f},
    {2.40430366e-11f, 5.55021075e-08f, -0.000198503712f, 0.0289312858f},
    {-1.40949732e-11f, 1.89878968e-07f, -0.000356632824f, 0.0910767778f},
    {-3.61460868e-11f, 2.84822009e-07f, -0.000493211319f, 0.15672344f},
    {-1.97075558e-11f, 1.75359216e-07f, -0.000250542516f, -0.0222785725f},
    {-1.619759e-13f, -1.64218833e-08f, 0.00038621747f, -0.738079076f},
    {6.72650189e-13f, -2.73078726e-08f, 0.000424098144f, -0.752335247f},
};
#define BLACKBODY_HIGHEST 12000.0f
static const float blackbody_lowest_color[3] = {5.4132943153f, -0.2031939f, -0.0822535f};
static const float blackbody_highest_color[3] = {0.826295495f, 0.994508028f, 1.566307664f};

/* A colour without negative components unless mode, TRC_GAMUT_*, keeps them. */
TRC_INLINE vvec3 in_gamut(uint32_t mode, vvec3 c) {
    const vfloat zero = vf_zero();
    if (mode == TRC_GAMUT_OPEN)
        return c;
    return v3(vf_max(c.x, zero), vf_max(c.y, zero), vf_max(c.z, zero));
}

static vvec3 op_blackbody(uint32_t mode, vfloat temperature) {
    const vfloat zero = vf_zero();
    vfloat r[3] = {zero, zero, zero}, g[3] = {zero, zero, zero}, b[4] = {zero, zero, zero, zero};
    for (int i = 0; i < BLACKBODY_SEGMENTS; i++) {
        const vmask above = vf_ge(temperature, vf_set(blackbody_from[i]));
        for (int k = 0; k < 3; k++) {
            r[k] = vf_select(above, vf_set(blackbody_red[i][k]), r[k]);
            g[k] = vf_select(above, vf_set(blackbody_green[i][k]), g[k]);
        }
        for (int k = 0; k < 4; k++)
            b[k] = vf_select(above, vf_set(blackbody_blue[i][k]), b[k]);
    }
    const vfloat t = temperature, inverse = vf_rcp(t);
    vvec3 color = v3(r[0] * inverse + r[1] * t + r[2], g[0] * inverse + g[1] * t + g[2],
                     ((b[0] * t + b[1]) * t + b[2]) * t + b[3]);
    color = v3_select(vf_ge(t, vf_set(BLACKBODY_HIGHEST)), v3_set(blackbody_highest_color), color);
    color = v3_select(vf_lt(t, vf_set(blackbody_from[0])), v3_set(blackbody_lowest_color), color);
    return in_gamut(mode, color);
}

/* ---- wavelengths ---- */

/* Colour matching functions of the 2 degree observer, CIE 1931, X Y Z from 380 to 780 nm. */
#define CIE_FIRST 380.0f
#define CIE_STEP 5.0f
#define CIE_COUNT 81
static const float cie_observer[CIE_COUNT][3] = {
    {0.0014f, 0.0000f, 0.0065f}, {0.0022f, 0.0001f, 0.0105f}, {0.0042f, 0.0001f, 0.0201f},
    {0.0076f, 0.0002f, 0.0362f}, {0.0143f, 0.0004f, 0.0679f}, {0.0232f, 0.0006f, 0.1102f},
    {0.0435f, 0.0012f, 0.2074f}, {0.0776f, 0.0022f, 0.3713f}, {0.1344f, 0.0040f, 0.6456f},
    {0.2148f, 0.0073f, 1.0391f}, {0.2839f, 0.0116f, 1.3856f}, {0.3285f, 0.0168f, 1.6230f},
    {0.3483f, 0.0230f, 1.7471f}, {0.3481f, 0.0298f, 1.7826f}, {0.3362f, 0.0380f, 1.7721f},
    {0.3187f, 0.0480f, 1.7441f}, {0.2908f, 0.0600f, 1.6692f}, {0.2511f, 0.0739f, 1.5281f},
    {0.1954f, 0.0910f, 1.2876f}, {0.1421f, 0.1126f, 1.0419f}, {0.0956f, 0.1390f, 0.8130f},
    {0.0580f, 0.1693f, 0.6162f}, {0.0320f, 0.2080f, 0.4652f}, {0.0147f, 0.2586f, 0.3533f},
    {0.0049f, 0.3230f, 0.2720f}, {0.0024f, 0.4073f, 0.2123f}, {0.0093f, 0.5030f, 0.1582f},
    {0.0291f, 0.6082f, 0.1117f}, {0.0633f, 0.7100f, 0.0782f}, {0.1096f, 0.7932f, 0.0573f},
    {0.1655f, 0.8620f, 0.0422f}, {0.2257f, 0.9149f, 0.0298f}, {0.2904f, 0.9540f, 0.0203f},
    {0.3597f, 0.9803f, 0.0134f}, {0.4334f, 0.9950f, 0.0087f}, {0.5121f, 1.0000f, 0.0057f},
    {0.5945f, 0.9950f, 0.0039f}, {0.6784f, 0.9786f, 0.0027f}, {0.7621f, 0.9520f, 0.0021f},
    {0.8425f, 0.9154f, 0.0018f}, {0.9163f, 0.8700f, 0.0017f}, {0.9786f, 0.8163f, 0.0014f},
    {1.0263f, 0.7570f, 0.0011f}, {1.0567f, 0.6949f, 0.0010f}, {1.0622f, 0.6310f, 0.0008f},
    {1.0456f, 0.5668f, 0.0006f}, {1.0026f, 0.5030f, 0.0003f}, {0.9384f, 0.4412f, 0.0002f},
    {0.8544f, 0.3810f, 0.0002f}, {0.7514f, 0.3210f, 0.0001f}, {0.6424f, 0.2650f, 0.0000f},
    {0.5419f, 0.2170f, 0.0000f}, {0.4479f, 0.1750f, 0.0000f}, {0.3608f, 0.1382f, 0.0000f},
    {0.2835f, 0.1070f, 0.0000f}, {0.2187f, 0.0816f, 0.0000f}, {0.1649f, 0.0610f, 0.0000f},
    {0.1212f, 0.0446f, 0.0000f}, {0.0874f, 0.0320f, 0.0000f}, {0.0636f, 0.0232f, 0.0000f},
    {0.0468f, 0.0170f, 0.0000f}, {0.0329f, 0.0119f, 0.0000f}, {0.0227f, 0.0082f, 0.0000f},
    {0.0158f, 0.0057f, 0.0000f}, {0.0114f, 0.0041f, 0.0000f}, {0.0081f, 0.0029f, 0.0000f},
    {0.0058f, 0.0021f, 0.0000f}, {0.0041f, 0.0015f, 0.0000f}, {0.0029f, 0.0010f, 0.0000f},
    {0.0020f, 0.0007f, 0.0000f}, {0.0014f, 0.0005f, 0.0000f}, {0.0010f, 0.0004f, 0.0000f},
    {0.0007f, 0.0002f, 0.0000f}, {0.0005f, 0.0002f, 0.0000f}, {0.0003f, 0.0001f, 0.0000f},
    {0.0002f, 0.0001f, 0.0000f}, {0.0002f, 0.0001f, 0.0000f}, {0.0001f, 0.0000f, 0.0000f},
    {0.0001f, 0.0000f, 0.0000f}, {0.0001f, 0.0000f, 0.0000f}, {0.0000f, 0.0000f, 0.0000f},
};
/* Brings the highest component of all wavelengths to about 1, as Cycles does. */
#define CIE_SCALE (1.0f / 2.52f)

/* nm -> Rec.709, straight between the samples. */
static vvec3 op_wavelength(uint32_t mode, vfloat wavelength) {
    const vfloat x = (wavelength - vf_set(CIE_FIRST)) * vf_set(1.0f / CIE_STEP);
    const vmask visible = vm_and(vf_gt(x, vf_set(-1.0f)), vf_lt(x, vf_set(CIE_COUNT - 1)));
    const vint i = vf_to_int(vf_trunc(vf_where(visible, x))), row = i + i + i;
    const vfloat t = x - vi_to_float(i);
    const vvec3 a = v3_gather(cie_observer[0], row, visible);
    const vvec3 b = v3_gather(cie_observer[1], row, visible);
    const vvec3 c = v3_lerp(a, b, t);
    const vfloat scale = vf_set(CIE_SCALE);
    const vfloat red =
        c.x * vf_set(3.2404542f) - c.y * vf_set(1.5371385f) - c.z * vf_set(0.4985314f);
    const vfloat green =
        c.y * vf_set(1.8760108f) - c.x * vf_set(0.9692660f) + c.z * vf_set(0.0415560f);
    const vfloat blue =
        c.x * vf_set(0.0556434f) - c.y * vf_set(0.2040259f) + c.z * vf_set(1.0572252f);
    return v3_where(visible, in_gamut(mode, v3(red * scale, green * scale, blue * scale)));
}

#endif
