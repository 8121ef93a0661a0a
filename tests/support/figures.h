/* Figures of tests for the table of stability (support/stability.py): what was measured, and what
 * came out, as printf has it. */
#ifndef TRACER_TESTS_FIGURES_H
#define TRACER_TESTS_FIGURES_H

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>

__attribute__((format(printf, 2, 3))) static inline void print_figure(const char *what,
                                                                      const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    printf("figure | %s | ", what);
    vprintf(format, arguments);
    printf("\n");
    va_end(arguments);
}

/* Of count rays that must hit, those that did not. */
static inline void print_misses(const char *what, uint64_t misses, uint64_t count) {
    print_figure(what, "%" PRIu64 " misses of %" PRIu64 " rays", misses, count);
}

/* Of count rays or more, each judged: a test that finds one wrong fails before it comes here. */
static inline void print_right(const char *what, uint64_t count) {
    print_figure(what, "0 wrong of %" PRIu64 " rays", count);
}

#endif
