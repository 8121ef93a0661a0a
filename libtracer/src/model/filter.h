/* The pixel filter as a table to draw places from.
 *
 * Samples of a pixel are drawn from the filter's shape, so that a pixel is a plain mean (Ernst,
 * Stamminger and Greiner, "Filter Importance Sampling", 2006; Cycles does the same, so images
 * agree). */
#ifndef TRACER_MODEL_FILTER_H
#define TRACER_MODEL_FILTER_H

#include <stdint.h>

#define TRC_FILTER_TABLE 1024

/* Inverse of the distribution of a TRC_FILTER_* of that width, pixels: entry i is the distance from
 * the pixel's middle that i / (TRC_FILTER_TABLE - 1) of the filter lies below. Takes about 100
 * microseconds. */
void trc_filter_table_fill(uint32_t filter, float width, float table[TRC_FILTER_TABLE]);

#endif
