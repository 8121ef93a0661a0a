/* What the test knows of bad_reader.c. */
#ifndef TRACER_UNIT_BAD_READER_H
#define TRACER_UNIT_BAD_READER_H

#define GOOD_WIDTH 3
#define GOOD_HEIGHT 5

#endif
