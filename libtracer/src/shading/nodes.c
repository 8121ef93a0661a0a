/* The table of node types: tracer/material.h in a form that code can check against. */
#include "shading/build.h"

#include <stddef.h>

static const struct trc_node_info infos[] = {
    {TRC_NODE_DIFFUSE, "Diffuse", "cfn", "color roughness normal", "s"},
    {TRC_NODE_GLOSSY, "Glossy", "cfffnt", "color roughness anisotropy rotation normal tangent",
     "s"},
    {TRC_NODE_GLASS, "Glass", "cffn", "color roughness ior normal", "s"},
    {TRC_NODE_REFRACTION, "Refraction", "cffn", "color roughness ior normal", "s"},
    {TRC_NODE_TRANSPARENT, "Transparent", "c", "color", "s"},
    {TRC_NODE_TRANSLUCENT, "Translucent", "cn", "color normal", "s"},
    {TRC_NODE_EMISSION, "Emission", "cf", "color strength", "s"},
    {TRC_NODE_BACKGROUND, "Background", "cf", "color strength", "s"},
    {TRC_NODE_MIX_SHADER, "Mix Shader", "fss", "factor first second", "s"},
    {TRC_NODE_ADD_SHADER, "Add Shader", "ss", "first second", "s"},
    {TRC_NODE_HOLDOUT, "Holdout", "", "", "s"},
    {TRC_NODE_PRINCIPLED, "Principled", "cfcfffffffffffffcffnnt",
     "base_color subsurface subsurface_color metallic specular specular_tint roughness anisotropic "
     "anisotropic_rotation sheen sheen_tint clearcoat clearcoat_roughness ior transmission "
     "transmission_roughness emission emission_strength alpha normal clearcoat_normal tangent",
     "s"},
    {TRC_NODE_VELVET, "Velvet", "cfn", "color sigma normal", "s"},
    {TRC_NODE_TOON, "Toon", "cffn", "color size smooth normal", "s"},
    {TRC_NODE_LAYERED_PRINCIPLED, "Principled", "cffffnffcfftffffcnffccf",
     "base_color metallic roughness ior alpha normal diffuse_roughness specular_ior_level "
     "specular_tint anisotropic anisotropic_rotation tangent transmission_weight coat_weight "
     "coat_roughness coat_ior coat_tint coat_normal sheen_weight sheen_roughness sheen_tint "
     "emission_color emission_strength",
     "s"},
    {TRC_NODE_SHEEN, "Sheen", "cfn", "color roughness normal", "s"},

    {TRC_NODE_IMAGE, "Image", "uf", "vector blend", "cf"},
    {TRC_NODE_ENVIRONMENT, "Environment", "p", "vector", "c"},
    {TRC_NODE_UV_MAP, "UV Map", "", "", "v"},
    {TRC_NODE_COLOR_ATTRIBUTE, "Color Attribute", "", "", "cf"},
    {TRC_NODE_TEXTURE_COORDINATE, "Texture Coordinate", "", "", "vvvvvvv"},
    {TRC_NODE_MAPPING, "Mapping", "cccc", "vector location rotation scale", "v"},
    {TRC_NODE_MIX_COLOR, "Mix Color", "fcc", "factor a b", "c"},
    {TRC_NODE_MATH, "Math", "fff", "a b c", "f"},
    {TRC_NODE_FRESNEL, "Fresnel", "fn", "ior normal", "f"},
    {TRC_NODE_LAYER_WEIGHT, "Layer Weight", "fn", "blend normal", "ff"},
    {TRC_NODE_LIGHT_PATH, "Light Path", "", "", "fffffffffffff"},
    {TRC_NODE_GEOMETRY, "Geometry", "", "", "vvvvvvfff"},
    {TRC_NODE_NORMAL_MAP, "Normal Map", "fc", "strength color", "v"},
    {TRC_NODE_INVERT, "Invert", "fc", "factor color", "c"},
    {TRC_NODE_GAMMA, "Gamma", "cf", "color gamma", "c"},
    {TRC_NODE_HUE_SATURATION, "Hue Saturation Value", "ffffc", "hue saturation value factor color",
     "c"},
    {TRC_NODE_BRIGHT_CONTRAST, "Bright/Contrast", "cff", "color bright contrast", "c"},
    {TRC_NODE_COLOR_RAMP, "Color Ramp", "f", "factor", "cf"},
    {TRC_NODE_SEPARATE, "Separate", "c", "color", "fff"},
    {TRC_NODE_COMBINE, "Combine", "fff", "x y z", "c"},
    {TRC_NODE_MAP_RANGE, "Map Range", "fffff", "value from_min from_max to_min to_max", "f"},
    {TRC_NODE_CLAMP, "Clamp", "fff", "value min max", "f"},
    {TRC_NODE_CHECKER, "Checker", "gccf", "vector color1 color2 scale", "cf"},
    {TRC_NODE_OBJECT_INFO, "Object Info", "", "", "vcffff"},
    {TRC_NODE_VECTOR_MATH, "Vector Math", "cccf", "a b c scale", "vf"},
    {TRC_NODE_RGB_TO_BW, "RGB to BW", "c", "color", "f"},
    {TRC_NODE_INSTANCE_VALUES, "Instance Values", "", "", "c"},

    {TRC_NODE_NOISE, "Noise", "gffffffff",
     "vector w scale detail roughness lacunarity offset gain distortion", "fc"},
    {TRC_NODE_MUSGRAVE, "Musgrave", "gfffffff",
     "vector w scale detail dimension lacunarity offset gain", "f"},
    {TRC_NODE_VORONOI, "Voronoi", "gffffffff",
     "vector w scale smoothness exponent randomness detail roughness lacunarity", "fcvff"},
    {TRC_NODE_WAVE, "Wave", "gffffff",
     "vector scale distortion detail detail_scale detail_roughness phase", "f"},
    {TRC_NODE_GRADIENT, "Gradient", "g", "vector", "f"},
    {TRC_NODE_WHITE_NOISE, "White Noise", "gf", "vector w", "fc"},
    {TRC_NODE_MAGIC, "Magic", "gff", "vector scale distortion", "cf"},
    {TRC_NODE_BRICK, "Brick", "gcccffffffff",
     "vector color1 color2 mortar scale mortar_size mortar_smooth bias brick_width row_height "
     "offset squash",
     "cf"},

    {TRC_NODE_CURVES, "Curves", "fcff", "factor color low high", "c"},
    {TRC_NODE_FLOAT_CURVE, "Float Curve", "ffff", "factor value low high", "f"},
    {TRC_NODE_BLACKBODY, "Blackbody", "f", "temperature", "c"},
    {TRC_NODE_WAVELENGTH, "Wavelength", "f", "wavelength", "c"},
    {TRC_NODE_VECTOR_TRANSFORM, "Vector Transform", "c", "vector", "v"},
    {TRC_NODE_VECTOR_ROTATE, "Vector Rotate", "cccfc", "vector center axis angle rotation", "v"},
    {TRC_NODE_CAMERA_DATA, "Camera Data", "", "", "vff"},
    {TRC_NODE_WIREFRAME, "Wireframe", "f", "size", "f"},
    {TRC_NODE_TANGENT, "Tangent", "", "", "v"},

    {TRC_NODE_AOV_VALUE, "AOV Value", "f", "value", ""},
    {TRC_NODE_AOV_COLOR, "AOV Color", "c", "color", ""},
};

const struct trc_node_info *trc_node_info_of(uint32_t type) {
    for (size_t i = 0; i < sizeof infos / sizeof *infos; i++) {
        if (infos[i].type == type)
            return &infos[i];
    }
    return NULL;
}

bool trc_node_is_shader(uint32_t type) { return type < TRC_NODE_IMAGE; }

bool trc_node_is_output(uint32_t type) {
    return type == TRC_NODE_AOV_VALUE || type == TRC_NODE_AOV_COLOR;
}

char trc_node_output_kind(const trc_node *node, uint32_t output) {
    if (node->type == TRC_NODE_COMBINE && node->mode == TRC_SEPARATE_XYZ)
        return 'v';
    return trc_node_info_of(node->type)->outputs[output];
}

#define CLAMP_BIT 256u

bool trc_node_mode_is_valid(uint32_t type, uint32_t mode) {
    const uint32_t base = mode & ~CLAMP_BIT;
    switch (type) {
    case TRC_NODE_GLOSSY:
    case TRC_NODE_GLASS:
    case TRC_NODE_REFRACTION:
        return (mode & ~(uint32_t)TRC_DISTRIBUTION_CORRELATED) <= TRC_DISTRIBUTION_ASHIKHMIN;
    case TRC_NODE_PRINCIPLED:
    case TRC_NODE_LAYERED_PRINCIPLED:
        return mode <= TRC_DISTRIBUTION_MULTI_GGX;
    case TRC_NODE_DIFFUSE:
    case TRC_NODE_TOON:
        return mode <= 1;
    case TRC_NODE_IMAGE:
        return mode < 64 && (mode & TRC_IMAGE_MODE_INTERPOLATION) <= TRC_IMAGE_CUBIC;
    case TRC_NODE_ENVIRONMENT:
        return (mode & ~(3u | 1u << 4)) == 0 && (mode & 3u) <= TRC_IMAGE_CUBIC;
    case TRC_NODE_INSTANCE_VALUES:
        return mode < TRC_MAX_INSTANCE_VALUES;
    case TRC_NODE_MAPPING:
        return mode <= 3;
    case TRC_NODE_MIX_COLOR:
        return base <= TRC_BLEND_EXCLUSION;
    case TRC_NODE_MATH:
        return base <= TRC_MATH_DEGREES;
    case TRC_NODE_NORMAL_MAP:
        return mode <= 4;
    case TRC_NODE_COLOR_RAMP:
        return mode <= 1;
    case TRC_NODE_SEPARATE:
    case TRC_NODE_COMBINE:
        return mode <= TRC_SEPARATE_XYZ;
    case TRC_NODE_MAP_RANGE:
        return base == 0;
    case TRC_NODE_CLAMP:
        return mode <= 1;
    case TRC_NODE_VECTOR_MATH:
        return mode <= TRC_VECTOR_REFRACT;
    case TRC_NODE_NOISE:
        return mode >> TRC_NOISE_TYPE_SHIFT <= TRC_FRACTAL_RIDGED_MULTIFRACTAL;
    case TRC_NODE_MUSGRAVE:
        return mode >> TRC_NOISE_TYPE_SHIFT <= TRC_FRACTAL_RIDGED_MULTIFRACTAL &&
               mode >> TRC_NOISE_TYPE_SHIFT != TRC_FRACTAL_FBM_UNIT;
    case TRC_NODE_VORONOI:
        return (mode & ~(uint32_t)TRC_VORONOI_NORMALIZE) >> TRC_VORONOI_FEATURE_SHIFT <=
               TRC_VORONOI_N_SPHERE_RADIUS;
    case TRC_NODE_WAVE:
        return mode >> (TRC_WAVE_DIRECTION_SHIFT + 2) == 0 &&
               (mode & TRC_WAVE_PROFILE) <= TRC_WAVE_TRIANGLE;
    case TRC_NODE_GRADIENT:
        return mode <= TRC_GRADIENT_SPHERICAL;
    case TRC_NODE_WHITE_NOISE:
        return mode <= 3;
    case TRC_NODE_CURVES:
    case TRC_NODE_FLOAT_CURVE:
        return mode <= 1;
    case TRC_NODE_VECTOR_TRANSFORM:
        return (mode & 3u) <= TRC_SPACE_CAMERA && (mode >> 2 & 3u) <= TRC_SPACE_CAMERA &&
               mode >> 4 <= 3;
    case TRC_NODE_VECTOR_ROTATE:
        return (mode & ~8u) <= TRC_ROTATE_EULER;
    case TRC_NODE_TANGENT:
        return mode <= TRC_TANGENT_UV;
    case TRC_NODE_AOV_VALUE:
    case TRC_NODE_AOV_COLOR:
        return mode < TRC_MAX_AOVS;
    case TRC_NODE_MAGIC:
        return mode <= 10;
    case TRC_NODE_BRICK:
        return mode >> 2 * TRC_BRICK_SQUASH_SHIFT == 0;
    default:
        return mode == 0;
    }
}
