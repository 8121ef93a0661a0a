/* The thread's message and the constant facts of the library. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "core/core.h"

#define MESSAGE_BYTES 512

static _Thread_local char message[MESSAGE_BYTES];

/* Ends text before an incomplete UTF-8 sequence, which cutting may have left. */
static void trim_utf8(char *text) {
    const size_t size = strlen(text);
    size_t start = size;
    while (start > 0 && size - start < 4 && ((uint8_t)text[start - 1] & 0xc0) == 0x80)
        start--;
    if (start == 0)
        return;
    const uint8_t lead = (uint8_t)text[start - 1];
    const size_t need = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : lead >= 0xc0 ? 2 : 1;
    if (size - (start - 1) < need)
        text[start - 1] = '\0';
}

trc_status trc_fail(trc_status status, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    const int size = vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    if (size < 0)
        message[0] = '\0';
    if (size >= MESSAGE_BYTES)
        trim_utf8(message);
    return status;
}

const char *trc_last_message(void) { return message; }
