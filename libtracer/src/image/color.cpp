// Colour spaces of OpenColorIO through OpenImageIO: see color.h.
#include "image/color.h"

#include <cmath>
#include <memory>
#include <string>

#include <OpenImageIO/color.h>

#include "image/guarded.h"

static const char task[] = "cannot convert from the colour space";

struct trc_color_transform {
    std::string space;
    OIIO::ColorProcessorHandle processor;
};

namespace {

// Processors do not always know it of themselves: colours along four axes are tried, the three
// channels and grey.
bool changes_nothing(OIIO::ColorProcessor &processor) {
    const int steps = 16;
    for (int i = 0; i < 4 * steps; i++) {
        const int axis = i / steps;
        const float value = float(i % steps) / float(steps - 1);
        float color[3], original[3];
        for (int c = 0; c < 3; c++)
            color[c] = original[c] = axis == c || axis == 3 ? value : 0.0f;
        processor.apply(color);
        for (int c = 0; c < 3; c++)
            if (!(std::fabs(color[c] - original[c]) <= 1e-6f))
                return false;
    }
    return true;
}

} // namespace

extern "C" trc_status trc_color_open(const char *config, const char *space,
                                     trc_color_transform **transform_out) {
    return guarded(task, space, [&]() -> trc_status {
        OIIO::ColorConfig colors(config);
        if (colors.has_error())
            return trc_fail(TRC_ERROR_IMAGE, "%s %s: %s", task, space, colors.geterror().c_str());
        std::unique_ptr<trc_color_transform> transform(new trc_color_transform());
        transform->space = space;
        transform->processor = colors.createColorProcessor(space, "scene_linear");
        if (!transform->processor)
            return trc_fail(TRC_ERROR_IMAGE, "%s %s: %s", task, space, colors.geterror().c_str());
        *transform_out = changes_nothing(*transform->processor) ? nullptr : transform.release();
        return TRC_OK;
    });
}

extern "C" trc_status trc_color_apply(const trc_color_transform *transform, float *rgba,
                                      uint32_t count) {
    return guarded(task, transform->space.c_str(), [&]() -> trc_status {
        const OIIO::stride_t texel = 4 * sizeof *rgba;
        transform->processor->apply(rgba, int(count), 1, 3, sizeof *rgba, texel, count * texel);
        return TRC_OK;
    });
}

extern "C" void trc_color_close(trc_color_transform *transform) { delete transform; }
