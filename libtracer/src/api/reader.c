/* Public calls on readers of image files. */
#include "image/reader.h"
#include "core/checks.h"
#include "core/handle.h"
#include "tracer/tracer.h"

trc_status trc_reader_create(const trc_reader_desc *desc, trc_reader *reader_out) {
    TRC_TRY(trc_check_struct(desc, sizeof *desc, "trc_reader_desc"));
    TRC_TRY(trc_check_enum(desc->reserved, 1, "reserved"));
    TRC_TRY(trc_check_out(reader_out, sizeof *reader_out, "reader_out"));
    struct trc_image_reader *reader;
    TRC_TRY(trc_image_reader_create(desc->program, desc->script, &reader));
    const trc_status status = trc_handle_create(TRC_HANDLE_READER, reader, reader_out);
    if (status != TRC_OK)
        trc_image_reader_release(reader);
    return status;
}

trc_status trc_reader_start(trc_reader reader) {
    void *object;
    TRC_TRY(trc_handle_acquire(reader, TRC_HANDLE_READER, &object));
    trc_image_reader_start(object);
    trc_handle_release(reader);
    return TRC_OK;
}

trc_status trc_reader_destroy(trc_reader reader) {
    void *object;
    TRC_TRY(trc_handle_acquire(reader, TRC_HANDLE_READER, &object));
    TRC_TRY(trc_handle_remove(reader));
    trc_image_reader_release(object);
    return TRC_OK;
}
