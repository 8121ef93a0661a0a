/* Frames rendered by the counting kernels: tests.h. */
#ifndef TRACER_BENCH_FRAMES_COUNTED_FRAME_H
#define TRACER_BENCH_FRAMES_COUNTED_FRAME_H

#include "frame.h"
#include "tests.h"

/* As frame_render, on the calling thread and without times; tests_out: RAY_CLASSES values. */
trc_status counted_frame_render(const struct frame_scene *scene, const struct spec *spec,
                                struct frame_result *out, struct trace_counts *tests_out);

#endif
