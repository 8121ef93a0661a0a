// Colour spaces of OpenColorIO configurations, through OpenImageIO.
#ifndef TRACER_READER_COLORS_H
#define TRACER_READER_COLORS_H

#include <memory>
#include <string>

#include <OpenImageIO/color.h>

#include "image/protocol.h"
#include "system.h"

// The transforms that a process was asked for: a configuration takes long to read and is kept.
class Colors {
  public:
    // Answer requests for a transform, and to apply it (see image/protocol.h).
    void serve_space(connection &to, const trc_reader_request &request);
    void serve_apply(connection &to, const trc_reader_request &request);

  private:
    void open(const std::string &config, const std::string &space);

    std::string config_path_, space_;
    std::unique_ptr<OIIO::ColorConfig> config_;
    OIIO::ColorProcessorHandle processor_;
    bool is_identity_ = false;
};

#endif
