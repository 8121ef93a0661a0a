// Image files through OpenImageIO.
#ifndef TRACER_READER_FILES_H
#define TRACER_READER_FILES_H

#include "image/protocol.h"
#include "system.h"

// Answers a request for a file (see image/protocol.h).
void serve_file(connection &to, const trc_reader_request &request);

#endif
