/* Lists of inputs and outputs (tracer/nodes.def, model/operations.def) as members of a struct, so
 * that offsetof finds them: floats as the compiler and programs lay values out, or one char each.
 */
#ifndef TRACER_MODEL_SOCKETS_H
#define TRACER_MODEL_SOCKETS_H

#include <stddef.h>
#include <stdint.h>

#define TRC_FLOATS_FLOAT(name) float name;
#define TRC_FLOATS_COLOR(name) float name[3];
#define TRC_FLOATS_VECTOR(name) float name[3];
#define TRC_FLOATS_SHADER(name)
#define TRC_FLOATS_NORMAL(name) float name[3];
#define TRC_FLOATS_TANGENT(name) float name[3];
#define TRC_FLOATS_UV(name) float name[3];
#define TRC_FLOATS_GENERATED(name) float name[3];
#define TRC_FLOATS_POSITION(name) float name[3];

/* Where a member of floats stands, in floats. */
#define TRC_FLOATS_BEFORE(type, member) ((uint32_t)(offsetof(type, member) / sizeof(float)))

#endif
