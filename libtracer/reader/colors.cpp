// Colour spaces through OpenImageIO: see colors.h.
#include "colors.h"

#include <cmath>

#include "reply.h"

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

void Colors::open(const std::string &config, const std::string &space) {
    if (!config_ || config != config_path_) {
        processor_.reset();
        config_.reset(new OIIO::ColorConfig(config));
        config_path_ = config;
    }
    if (config_->has_error()) {
        const std::string reason = config_->geterror();
        config_.reset();
        throw Failure(TRC_ERROR_IMAGE, reason);
    }
    if (processor_ && space == space_)
        return;
    processor_ = config_->createColorProcessor(space, "scene_linear");
    space_ = space;
    if (!processor_)
        throw Failure(TRC_ERROR_IMAGE, config_->geterror());
    is_identity_ = changes_nothing(*processor_);
}

void Colors::serve_space(connection &to, const trc_reader_request &request) {
    guarded(to, [&]() {
        const std::string config(to.shared, request.text_bytes[0] - 1);
        const std::string space(to.shared + request.text_bytes[0], request.text_bytes[1] - 1);
        system_limit_memory(request.memory_bytes);
        open(config, space);
        trc_reader_answer answer = answer_of(TRC_READER_DONE);
        answer.is_identity = is_identity_;
        reply(to, answer);
    });
}

void Colors::serve_apply(connection &to, const trc_reader_request &request) {
    guarded(to, [&]() {
        const OIIO::stride_t texel = 4 * sizeof(float), row = request.count * texel;
        char *colors = to.shared + request.slot * TRC_READER_SLOT_BYTES;
        processor_->apply(reinterpret_cast<float *>(colors), int(request.count), 1, 3,
                          sizeof(float), texel, row);
        reply(to, answer_of(TRC_READER_DONE));
    });
}
