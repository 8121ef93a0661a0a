#include "dicing/faces.h"

#include "core/core.h"

void trc_faces_free(struct trc_faces *faces) {
    trc_free(faces->begin);
    trc_free(faces->indices);
    trc_free(faces->vertices);
    trc_free(faces->corners);
    trc_free(faces->material_index);
    trc_free(faces->smooth);
    trc_free(faces->edge_sharpness);
    trc_free(faces->vertex_sharpness);
    *faces = (struct trc_faces){.vertex_count = 0};
}
