// The program that reads images for the library: nothing else links OpenImageIO. It is started with
// a stream to the library and makes processes, each of which serves requests (image/protocol.h) one
// by one until it is ended, by whatever.
#include <algorithm>
#include <chrono>
#include <memory>
#include <string>
#include <thread>

#include <OpenImageIO/imageio.h>

#include "colors.h"
#include "files.h"
#include "reply.h"
#include "system.h"

namespace {

// Blocks of an EXR file that are decoded at once: more than a slot holds are of no use.
const int max_threads = 8;

// For a thread to end that has nothing to do.
const std::chrono::seconds thread_patience(5);

void serve(connection *to) {
    try {
        Colors colors;
        trc_reader_request request;
        while (connection_receive(to, &request, sizeof request, true) &&
               request.magic == TRC_READER_MAGIC) {
            if (request.kind == TRC_READER_FILE)
                serve_file(*to, request);
            else if (request.kind == TRC_READER_COLORS)
                colors.serve_space(*to, request);
            else if (request.kind == TRC_READER_APPLY)
                colors.serve_apply(*to, request);
        }
    } catch (const Gone &) {
    }
}

// Several files are read at once by several processes, which need no threads for that. OpenImageIO
// starts one all the same and ends it at once: a process that is copied while that thread holds the
// lock of its pool would wait for ever.
void do_without_threads() {
    const size_t own = system_count_threads();
    const auto deadline = std::chrono::steady_clock::now() + thread_patience;
    OIIO::attribute("threads", 1);
    while (system_count_threads() > own && std::chrono::steady_clock::now() < deadline)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

// Files that their own format's reader refuses are tried with all others, of which one reads a
// large dictionary first. Readers that start threads must not be tried here: processes would miss
// them.
void prepare_readers() {
    OIIO::ImageSpec spec;
    const std::unique_ptr<OIIO::ImageInput> dicom = OIIO::ImageInput::create("dicom");
    if (dicom)
        (void)dicom->open("/dev/null", spec);
    (void)OIIO::geterror();
}

} // namespace

int main() {
    system_prepare();
    do_without_threads();
    const int processors = int(std::thread::hardware_concurrency());
    OIIO::attribute("exr_threads", std::max(1, std::min(processors, max_threads)));
    // All that does not depend on a file is done before processes are made.
    (void)OIIO::get_string_attribute("input_format_list");
    prepare_readers();
    return system_launch(serve);
}
