/* How one texel is stored; for C and C++. */
#ifndef TRACER_MODEL_TEXEL_FORMAT_H
#define TRACER_MODEL_TEXEL_FORMAT_H

enum trc_texel {
    TRC_TEXEL_U8,  /* 4 bytes, value / 255 */
    TRC_TEXEL_U16, /* 8 bytes, value / 65535 */
    TRC_TEXEL_F16, /* 8 bytes, finite */
    TRC_TEXEL_F32  /* 16 bytes, finite */
};

#endif
