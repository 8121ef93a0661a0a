/* libtracer: packet-based Whitted and distribution ray tracing.
 *
 * The system of Boulos, Edwards, Lacewell, Kniss, Kautz, Shirley and Wald, "Packet-based Whitted
 * and Distribution Ray Tracing" (2007): camera rays, ideal and glossy reflection and refraction,
 * direct light with soft shadows, lens and motion blur. Not modelled: diffuse interreflection,
 * caustics seen from diffuse surfaces, volumes.
 *
 * A program: trc_scene_create; create meshes, materials, instances, lights; set camera and world;
 * trc_scene_commit; trc_render_start; trc_render_wait or poll; trc_render_read; destroy. */
#ifndef TRACER_TRACER_H
#define TRACER_TRACER_H

#include "tracer/base.h"
#include "tracer/camera.h"
#include "tracer/curves.h"
#include "tracer/geometry.h"
#include "tracer/light.h"
#include "tracer/material.h"
#include "tracer/query.h"
#include "tracer/reader.h"
#include "tracer/render.h"
#include "tracer/scene.h"
#include "tracer/tangents.h"
#include "tracer/version.h"

#endif
