/* The library's side of reading images: see reader.h, protocol.h. */
#define _POSIX_C_SOURCE 200809L
#include "image/reader.h"

#include <inttypes.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "image/image.h"
#include "image/process.h"
#include "image/protocol.h"
#include "model/texel.h"

#define PROGRAM "tracer_reader"

/* As much as a status' message, cut to that if need be. */
#define REASON_BYTES 1024

/* Idle processes that are kept. */
#define MAX_IDLE 16
/* For the program to load its libraries, times the patience with a step: some are many. */
#define START_FACTOR 2.0
/* Without progress: a disk may have to be woken, the processor may be busy with other things. */
#define PATIENCE_SECONDS 30.0
#define PATIENCE_BYTES_PER_SECOND 1e6
/* How soon a read that was cancelled gives up. */
#define CANCEL_SECONDS 0.05

/* What a file may take of address space before its picture's size is known: formats that are
 * decoded as a whole do that when they are opened. Then, for each byte of the picture: libraries
 * hold it once or twice, and again as wider numbers. */
#define OPEN_BYTES ((uint64_t)1 << 30)
#define OPEN_BYTES_PER_FILE_BYTE 64
#define MEMORY_PER_BYTE 4
/* A picture may be large, or much larger than its file, but not both: what runs of one colour come
 * to in the formats that compress best. */
#define PICTURE_BYTES ((uint64_t)256 << 20)
#define PICTURE_BYTES_PER_FILE_BYTE 4096

struct trc_image_reader {
    atomic_uint refs;
    char *program, *script; /* script: NULL for none */
    double patience;
    pthread_mutex_t lock; /* what follows */
    struct trc_launcher *launcher;
    bool has_run;              /* a launcher has made a process */
    bool is_unusable;          /* it never did, and is not tried again */
    char reason[REASON_BYTES]; /* why */
    struct trc_process *idle[MAX_IDLE];
    uint32_t idle_count;
};

/* ---- life ---- */

static char *copy_of(const char *text) {
    char *copy = trc_alloc(strlen(text) + 1, 1);
    if (copy)
        memcpy(copy, text, strlen(text) + 1);
    return copy;
}

trc_status trc_image_reader_create(const char *program, const char *script,
                                   struct trc_image_reader **reader_out) {
    struct trc_image_reader *reader = trc_alloc_zeroed(1, sizeof *reader);
    if (reader) {
        reader->program = program ? copy_of(program) : trc_file_beside_library(PROGRAM);
        reader->script = script ? copy_of(script) : NULL;
    }
    if (!reader || !reader->program || (script && !reader->script) ||
        pthread_mutex_init(&reader->lock, NULL)) {
        if (reader) {
            trc_free(reader->program);
            trc_free(reader->script);
        }
        trc_free(reader);
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a reader of images");
    }
    atomic_init(&reader->refs, 1);
    reader->patience = PATIENCE_SECONDS;
    *reader_out = reader;
    return TRC_OK;
}

struct trc_image_reader *trc_image_reader_retain(struct trc_image_reader *reader) {
    if (reader)
        atomic_fetch_add_explicit(&reader->refs, 1, memory_order_relaxed);
    return reader;
}

void trc_image_reader_rest(struct trc_image_reader *reader) {
    pthread_mutex_lock(&reader->lock);
    while (reader->idle_count)
        (void)trc_process_destroy(reader->idle[--reader->idle_count]);
    pthread_mutex_unlock(&reader->lock);
}

void trc_image_reader_release(struct trc_image_reader *reader) {
    if (!reader || atomic_fetch_sub_explicit(&reader->refs, 1, memory_order_acq_rel) != 1)
        return;
    if (reader->launcher)
        trc_launcher_end(reader->launcher);
    for (uint32_t i = 0; i < reader->idle_count; i++)
        (void)trc_process_destroy(reader->idle[i]);
    pthread_mutex_destroy(&reader->lock);
    trc_free(reader->program);
    trc_free(reader->script);
    trc_free(reader);
}

void trc_image_reader_set_patience(struct trc_image_reader *reader, double seconds) {
    reader->patience = seconds;
}

/* ---- processes ---- */

/* There will be no processes. started: "" or the path of what was, but did not do; what it did is
 * the message of the failed call. Under the lock. */
static trc_status give_up(struct trc_image_reader *reader, const char *started) {
    reader->is_unusable = true;
    (void)snprintf(reader->reason, sizeof reader->reason, "image files cannot be read: %s%s%s",
                   started, started[0] ? " was started, but " : "", trc_last_message());
    return trc_fail(TRC_ERROR_UNSUPPORTED, "%s", reader->reason);
}

/* A launcher that can be asked for processes. Under the lock. */
static trc_status ensure_launcher(struct trc_image_reader *reader) {
    if (reader->is_unusable)
        return trc_fail(TRC_ERROR_UNSUPPORTED, "%s", reader->reason);
    if (reader->launcher && trc_launcher_is_sound(reader->launcher))
        return TRC_OK;
    if (reader->launcher)
        trc_launcher_end(reader->launcher);
    reader->launcher = NULL;
    const trc_status status =
        trc_launcher_start(reader->program, reader->script, &reader->launcher);
    return status == TRC_ERROR_UNSUPPORTED ? give_up(reader, "") : status;
}

/* Under the lock. A launcher that has ended since is started again. */
static trc_status create_process(struct trc_image_reader *reader,
                                 struct trc_process **process_out) {
    trc_status status = TRC_OK;
    for (int attempt = 0; attempt < 2; attempt++) {
        TRC_TRY(ensure_launcher(reader));
        status = trc_process_create(reader->launcher, TRC_READER_SHARED_BYTES,
                                    START_FACTOR * reader->patience, process_out);
        if (status != TRC_ERROR_UNSUPPORTED)
            break;
        if (!reader->has_run)
            return give_up(reader, reader->program);
    }
    reader->has_run |= status == TRC_OK;
    return status;
}

void trc_image_reader_start(struct trc_image_reader *reader) {
    pthread_mutex_lock(&reader->lock);
    (void)ensure_launcher(reader);
    pthread_mutex_unlock(&reader->lock);
}

/* was_used: it has read something before. */
static trc_status take_process(struct trc_image_reader *reader, bool fresh,
                               struct trc_process **process_out, bool *was_used) {
    trc_status status = TRC_OK;
    struct trc_process *process = NULL;
    pthread_mutex_lock(&reader->lock);
    while (!fresh && !process && reader->idle_count) {
        process = reader->idle[--reader->idle_count];
        if (!trc_process_is_idle(process)) {
            (void)trc_process_destroy(process);
            process = NULL;
        }
    }
    *was_used = process != NULL;
    if (!process)
        status = create_process(reader, &process);
    pthread_mutex_unlock(&reader->lock);
    if (status == TRC_OK)
        *process_out = process;
    return status;
}

static void keep_process(struct trc_image_reader *reader, struct trc_process *process) {
    pthread_mutex_lock(&reader->lock);
    const bool has_room = reader->idle_count < MAX_IDLE;
    if (has_room)
        reader->idle[reader->idle_count++] = process;
    pthread_mutex_unlock(&reader->lock);
    if (!has_room)
        (void)trc_process_destroy(process);
}

/* ---- answers ---- */

/* Why a process cannot be asked any more. */
enum loss { LOSS_NONE, LOSS_ENDED, LOSS_LATE, LOSS_NONSENSE };

/* One call that a process serves. */
struct call {
    struct trc_process *process;
    const char *task, *object; /* "cannot read the image", a path */
    const atomic_uint *cancel;
    double patience;
    enum loss loss;
};

static trc_status lost(struct call *call, enum loss loss) {
    call->loss = loss;
    return TRC_ERROR_IMAGE; /* its message is made when it is known how the process ended */
}

static trc_status fail_lost(const struct call *call, const struct trc_process_exit *exit) {
    char reason[80];
    if (call->loss == LOSS_LATE)
        (void)snprintf(reason, sizeof reason, "no progress for %.0f s", call->patience);
    else if (call->loss == LOSS_NONSENSE)
        (void)snprintf(reason, sizeof reason, "its reader says nonsense");
    else if (!exit->is_known)
        (void)snprintf(reason, sizeof reason, "its reader has ended");
    else if (exit->signal)
        (void)snprintf(reason, sizeof reason, "its reader died of signal %" PRId32, exit->signal);
    else
        (void)snprintf(reason, sizeof reason, "its reader ended with code %" PRId32, exit->code);
    return trc_fail(TRC_ERROR_IMAGE, "%s %s: %s", call->task, call->object, reason);
}

static trc_status send_request(struct call *call, const struct trc_reader_request *request) {
    return trc_process_send(call->process, request, sizeof *request) ? TRC_OK
                                                                     : lost(call, LOSS_ENDED);
}

/* A text from a process as one line. */
static void clean_text(char *text, size_t size) {
    text[size - 1] = '\0';
    size_t end = 0;
    for (size_t i = 0; text[i]; i++) {
        if ((unsigned char)text[i] < ' ' || text[i] == '\x7f')
            text[i] = ' ';
        if (text[i] != ' ')
            end = i + 1;
    }
    text[end] = '\0';
}

/* What a process says of a failure, if that is something it may say. */
static trc_status fail_answer(struct call *call, struct trc_reader_answer *answer) {
    switch (answer->status) {
    case TRC_ERROR_IMAGE:
    case TRC_ERROR_TOO_LARGE:
    case TRC_ERROR_OUT_OF_MEMORY:
    case TRC_ERROR_FORMAT:
        clean_text(answer->text, sizeof answer->text);
        return trc_fail(answer->status, "%s %s: %s", call->task, call->object, answer->text);
    default:
        return lost(call, LOSS_NONSENSE);
    }
}

static enum trc_received receive_answer(struct call *call, struct trc_reader_answer *answer) {
    if (!call->cancel)
        return trc_process_receive(call->process, answer, sizeof *answer, call->patience);
    const double deadline = trc_seconds() + call->patience;
    enum trc_received received;
    do {
        const double left = deadline - trc_seconds();
        received = trc_process_receive(call->process, answer, sizeof *answer,
                                       left < CANCEL_SECONDS ? left : CANCEL_SECONDS);
    } while (received == TRC_RECEIVED_LATE && trc_seconds() < deadline &&
             !atomic_load(call->cancel));
    return received;
}

/* The next answer, of a kind. */
static trc_status take_answer(struct call *call, uint32_t kind, struct trc_reader_answer *answer) {
    switch (receive_answer(call, answer)) {
    case TRC_RECEIVED_ENDED:
        return lost(call, LOSS_ENDED);
    case TRC_RECEIVED_LATE:
        if (call->cancel && atomic_load(call->cancel))
            return trc_fail(TRC_ERROR_CANCELLED, "reading %s was cancelled", call->object);
        return lost(call, LOSS_LATE);
    case TRC_RECEIVED:
        break;
    }
    if (answer->magic != TRC_READER_MAGIC)
        return lost(call, LOSS_NONSENSE);
    if (answer->kind == TRC_READER_FAILED)
        return fail_answer(call, answer);
    return answer->kind == kind ? TRC_OK : lost(call, LOSS_NONSENSE);
}

/* Runs a call on an idle process, and once more on a new one if the former had read something
 * before, which may be to blame. */
static trc_status run(struct trc_image_reader *reader, struct call *call,
                      trc_status (*body)(struct call *call, void *context), void *context) {
    for (bool fresh = false;; fresh = true) {
        bool was_used;
        call->loss = LOSS_NONE;
        TRC_TRY(take_process(reader, fresh, &call->process, &was_used));
        trc_status status = body(call, context);
        if (status == TRC_OK) {
            keep_process(reader, call->process);
            return TRC_OK;
        }
        const struct trc_process_exit exit = trc_process_destroy(call->process);
        if (call->loss != LOSS_NONE)
            status = fail_lost(call, &exit);
        if (!was_used || call->loss == LOSS_LATE || status == TRC_ERROR_CANCELLED)
            return status;
    }
}

/* ---- files ---- */

struct file_call {
    const char *path; /* absolute */
    uint64_t file_bytes;
    const struct trc_file_taker *taker;
};

static const uint8_t channel_bytes[] = {
    [TRC_TEXEL_U8] = 1, [TRC_TEXEL_U16] = 2, [TRC_TEXEL_F16] = 2, [TRC_TEXEL_F32] = 4};

/* At most half of what the system has: the rest is for the picture and for the host. */
static uint64_t memory_limit(uint64_t bytes) {
    const uint64_t half = trc_memory_available() / 2;
    return bytes < half ? bytes : half;
}

static uint64_t pixel_bytes_max(const struct file_call *file) {
    return PICTURE_BYTES + PICTURE_BYTES_PER_FILE_BYTE * file->file_bytes;
}

static uint64_t picture_bytes(const struct trc_reader_answer *info) {
    return (uint64_t)info->width * info->height * info->channels * channel_bytes[info->format];
}

/* Sizes are as the file claims. */
static trc_status check_info(struct call *call, const struct file_call *file,
                             const struct trc_reader_answer *answer) {
    if (answer->channels < 1 || answer->channels > 4 || answer->format > TRC_TEXEL_F32 ||
        answer->is_unassociated > 1 || !answer->width || !answer->height)
        return lost(call, LOSS_NONSENSE);
    TRC_TRY(trc_image_check_size(answer->width, answer->height, answer->format, call->object));
    return picture_bytes(answer) <= pixel_bytes_max(file) ? TRC_OK : lost(call, LOSS_NONSENSE);
}

static trc_status take_rows(struct call *call, const struct file_call *file,
                            const struct trc_file_info *info) {
    const uint64_t row_bytes = (uint64_t)info->width * info->channels * channel_bytes[info->format];
    const char *shared = trc_process_shared(call->process);
    uint32_t slot = 0;
    for (uint32_t row = 0; row < info->height; slot = !slot) {
        struct trc_reader_answer answer;
        TRC_TRY(take_answer(call, TRC_READER_ROWS, &answer));
        if (answer.slot != slot || !answer.row_count || answer.row_count > info->height - row ||
            answer.row_count > TRC_READER_SLOT_BYTES / row_bytes)
            return lost(call, LOSS_NONSENSE);
        file->taker->rows(file->taker->context, row, answer.row_count,
                          shared + slot * TRC_READER_SLOT_BYTES);
        row += answer.row_count;
        const struct trc_reader_request taken = {.magic = TRC_READER_MAGIC,
                                                 .kind = TRC_READER_TAKEN};
        if (row < info->height)
            TRC_TRY(send_request(call, &taken));
    }
    return TRC_OK;
}

static trc_status call_file(struct call *call, void *context) {
    const struct file_call *file = context;
    struct trc_reader_answer answer;
    struct trc_reader_request request = {
        .magic = TRC_READER_MAGIC,
        .kind = TRC_READER_FILE,
        .memory_bytes = memory_limit(OPEN_BYTES + OPEN_BYTES_PER_FILE_BYTE * file->file_bytes),
        .memory_bytes_max = memory_limit(UINT64_MAX),
        .memory_per_byte = MEMORY_PER_BYTE,
        .pixel_bytes_max = pixel_bytes_max(file),
        .text_bytes = {(uint32_t)strlen(file->path) + 1}};
    memcpy(trc_process_shared(call->process), file->path, request.text_bytes[0]);
    trc_process_limit_memory(call->process, request.memory_bytes);
    TRC_TRY(send_request(call, &request));
    TRC_TRY(take_answer(call, TRC_READER_INFO, &answer));
    TRC_TRY(check_info(call, file, &answer));
    const uint64_t wanted = request.memory_bytes + MEMORY_PER_BYTE * picture_bytes(&answer);
    trc_process_limit_memory(call->process,
                             wanted < request.memory_bytes_max ? wanted : request.memory_bytes_max);
    const struct trc_file_info info = {.width = answer.width,
                                       .height = answer.height,
                                       .channels = answer.channels,
                                       .format = answer.format,
                                       .is_unassociated = answer.is_unassociated};
    TRC_TRY(file->taker->begin(file->taker->context, &info));
    TRC_TRY(take_rows(call, file, &info));
    return take_answer(call, TRC_READER_DONE, &answer);
}

trc_status trc_image_reader_read(struct trc_image_reader *reader, const char *path,
                                 const struct trc_file_taker *taker) {
    struct file_call file = {.taker = taker};
    char *absolute;
    TRC_TRY(trc_file_look(path, &absolute, &file.file_bytes));
    file.path = absolute;
    struct call call = {.task = "cannot read the image",
                        .object = path,
                        .cancel = taker->cancel,
                        .patience =
                            reader->patience + (double)file.file_bytes / PATIENCE_BYTES_PER_SECOND};
    trc_status status;
    if (strlen(absolute) >= TRC_READER_SLOT_BYTES)
        status = trc_fail(TRC_ERROR_IMAGE, "the path of an image is too long");
    else
        status = run(reader, &call, call_file, &file);
    trc_free(absolute);
    return status;
}

/* ---- colours ---- */

struct color_call {
    const char *config; /* absolute */
    const char *space;
    const struct trc_color_batches *batches;
    bool has_begun;
    uint64_t done; /* colours that have been stored */
};

static float *slot_of(const struct call *call, uint64_t batch) {
    char *shared = trc_process_shared(call->process);
    return (float *)(shared + batch % TRC_READER_SLOTS * TRC_READER_SLOT_BYTES);
}

static uint32_t batch_size(uint64_t count, uint64_t first) {
    return count - first < TRC_READER_COLORS_MAX ? (uint32_t)(count - first)
                                                 : TRC_READER_COLORS_MAX;
}

/* Two batches are under way: while the process transforms one, the other is stored and loaded. */
static trc_status apply(struct call *call, struct color_call *color) {
    const struct trc_color_batches *batches = color->batches;
    uint64_t sent = color->done;
    for (uint64_t next = 0, answered = 0; color->done < batches->count;) {
        if (sent < batches->count && next - answered < TRC_READER_SLOTS) {
            const uint32_t count = batch_size(batches->count, sent);
            const struct trc_reader_request request = {.magic = TRC_READER_MAGIC,
                                                       .kind = TRC_READER_APPLY,
                                                       .slot = (uint32_t)(next % TRC_READER_SLOTS),
                                                       .count = count};
            batches->load(batches->context, sent, count, slot_of(call, next));
            TRC_TRY(send_request(call, &request));
            sent += count;
            next++;
            continue;
        }
        struct trc_reader_answer answer;
        TRC_TRY(take_answer(call, TRC_READER_DONE, &answer));
        const uint32_t count = batch_size(batches->count, color->done);
        batches->store(batches->context, color->done, count, slot_of(call, answered++));
        color->done += count;
    }
    return TRC_OK;
}

static trc_status call_colors(struct call *call, void *context) {
    struct color_call *color = context;
    struct trc_reader_answer answer;
    const struct trc_reader_request request = {
        .magic = TRC_READER_MAGIC,
        .kind = TRC_READER_COLORS,
        .memory_bytes = memory_limit(OPEN_BYTES),
        .memory_bytes_max = memory_limit(OPEN_BYTES),
        .text_bytes = {(uint32_t)strlen(color->config) + 1, (uint32_t)strlen(color->space) + 1}};
    char *text = trc_process_shared(call->process);
    memcpy(text, color->config, request.text_bytes[0]);
    memcpy(text + request.text_bytes[0], color->space, request.text_bytes[1]);
    trc_process_limit_memory(call->process, request.memory_bytes);
    TRC_TRY(send_request(call, &request));
    TRC_TRY(take_answer(call, TRC_READER_DONE, &answer));
    if (answer.is_identity)
        return TRC_OK;
    if (!color->has_begun)
        TRC_TRY(color->batches->begin(color->batches->context));
    color->has_begun = true;
    return apply(call, color);
}

trc_status trc_image_reader_convert(struct trc_image_reader *reader, const char *config,
                                    const char *space, const struct trc_color_batches *batches) {
    struct color_call color = {.space = space, .batches = batches};
    struct call call = {.task = "cannot convert from the colour space",
                        .object = space,
                        .cancel = batches->cancel,
                        .patience = reader->patience};
    uint64_t bytes;
    char *absolute = NULL;
    /* What is no file may be the name of a configuration that OpenColorIO brings. */
    const bool is_file = trc_file_look(config, &absolute, &bytes) == TRC_OK;
    color.config = is_file ? absolute : config;
    trc_status status;
    if (strlen(color.config) + strlen(space) + 2 > TRC_READER_SLOT_BYTES)
        status = trc_fail(TRC_ERROR_IMAGE, "the name of a colour space is too long");
    else
        status = run(reader, &call, call_colors, &color);
    trc_free(absolute);
    return status;
}
