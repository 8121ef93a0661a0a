// Image files through OpenImageIO: see oiio.h.
#include "image/oiio.h"

#include <memory>
#include <string>

#include <OpenImageIO/imageio.h>

#include "image/guarded.h"

// As in image/image.h, which C++ cannot read: its counts are C atomics.
enum { TEXEL_U8, TEXEL_U16, TEXEL_F16, TEXEL_F32 };

struct trc_oiio {
    std::string path;
    std::unique_ptr<OIIO::ImageInput> input;
    trc_file_info info;
};

namespace {

const char task[] = "cannot read the image";

// The widest of the file's channels decides.
uint32_t format_of(const OIIO::ImageSpec &spec) {
    uint32_t format = TEXEL_U8;
    const int count = spec.channelformats.empty() ? 1 : int(spec.channelformats.size());
    for (int i = 0; i < count; i++) {
        uint32_t own = TEXEL_F32;
        switch (spec.channelformat(i).basetype) {
        case OIIO::TypeDesc::UINT8:
        case OIIO::TypeDesc::INT8:
            own = TEXEL_U8;
            break;
        case OIIO::TypeDesc::UINT16:
        case OIIO::TypeDesc::INT16:
            own = TEXEL_U16;
            break;
        case OIIO::TypeDesc::HALF:
            own = TEXEL_F16;
            break;
        default:
            break;
        }
        // Whole numbers of 16 bits do not fit into half floats.
        if (own != format && own + format == TEXEL_U16 + TEXEL_F16)
            own = TEXEL_F32;
        if (own > format)
            format = own;
    }
    return format;
}

// Whether colours still have to be multiplied by alpha. Some readers do not say; Blender takes
// Targa, DDS and Photoshop files as not multiplied unless marked, and so does this.
bool is_unassociated(const OIIO::ImageInput &input, const OIIO::ImageSpec &spec) {
    const std::string format = input.format_name();
    if (spec.get_int_attribute("oiio:UnassociatedAlpha", 0) != 0)
        return true;
    if (format == "targa")
        return spec.get_int_attribute("targa:alpha_type", -1) != 4;
    return format == "dds" || format == "psd";
}

OIIO::TypeDesc type_of(uint32_t format) {
    switch (format) {
    case TEXEL_U8:
        return OIIO::TypeDesc::UINT8;
    case TEXEL_U16:
        return OIIO::TypeDesc::UINT16;
    case TEXEL_F16:
        return OIIO::TypeDesc::HALF;
    default:
        return OIIO::TypeDesc::FLOAT;
    }
}

trc_status fail_open(const char *path, const std::string &reason) {
    return trc_fail(TRC_ERROR_IMAGE, "%s %s: %s", task, path, reason.c_str());
}

} // namespace

extern "C" trc_status trc_oiio_open(const char *path, trc_oiio **file_out,
                                    trc_file_info *info_out) {
    return guarded(task, path, [&]() -> trc_status {
        std::unique_ptr<trc_oiio> file(new trc_oiio());
        file->path = path;
        // Alpha is left as it is in the file: it is multiplied later, as the alpha mode says.
        OIIO::ImageSpec config, spec;
        config.attribute("oiio:UnassociatedAlpha", 1);
        file->input = OIIO::ImageInput::create(path, false, &config);
        if (!file->input)
            return fail_open(path, OIIO::geterror());
        file->input->threads(1); // no thread pool in the host's process
        if (!file->input->open(path, spec, config))
            return fail_open(path, file->input->geterror());
        if (spec.width <= 0 || spec.height <= 0 || spec.depth > 1 || spec.nchannels <= 0)
            return fail_open(path, "it has no pixels in two dimensions");
        file->info.width = uint32_t(spec.width);
        file->info.height = uint32_t(spec.height);
        file->info.channels = uint32_t(spec.nchannels < 4 ? spec.nchannels : 4);
        file->info.format = format_of(spec);
        file->info.is_unassociated = is_unassociated(*file->input, spec);
        *info_out = file->info;
        *file_out = file.release();
        return TRC_OK;
    });
}

extern "C" trc_status trc_oiio_read(trc_oiio *file, void *texels, uint64_t capacity,
                                    uint64_t texel_bytes, uint64_t row_bytes) {
    return guarded(task, file->path.c_str(), [&]() -> trc_status {
        const trc_file_info &info = file->info;
        if (texel_bytes * info.width > row_bytes || row_bytes * info.height > capacity)
            return fail_open(file->path.c_str(), "the buffer is too small");
        // Files have the top row first: rows are written backwards from the last.
        char *top = static_cast<char *>(texels) + row_bytes * (info.height - 1);
        const OIIO::stride_t step = -OIIO::stride_t(row_bytes);
        if (!file->input->read_image(0, 0, 0, int(info.channels), type_of(info.format), top,
                                     OIIO::stride_t(texel_bytes), step))
            return fail_open(file->path.c_str(), file->input->geterror());
        return TRC_OK;
    });
}

extern "C" void trc_oiio_close(trc_oiio *file) {
    if (!file)
        return;
    guarded(task, "", [&]() -> trc_status {
        delete file;
        return TRC_OK;
    });
}
