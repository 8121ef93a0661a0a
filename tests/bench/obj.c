#include "obj.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LINE_BYTES 4096

struct obj_reader {
    struct mesh *mesh;
    const char *path;
    unsigned long line;
    char *message;
    size_t capacity;
};

static bool fail(const struct obj_reader *r, const char *what) {
    snprintf(r->message, r->capacity, "%s:%lu: %s", r->path, r->line, what);
    return false;
}

static bool fail_file(const struct obj_reader *r, const char *what) {
    snprintf(r->message, r->capacity, "%s: %s", r->path, what);
    return false;
}

static bool read_vertex(const struct obj_reader *r, const char *text) {
    float p[3];
    if (sscanf(text, "%f %f %f", &p[0], &p[1], &p[2]) != 3)
        return fail(r, "a vertex needs three numbers");
    mesh_add_vertex(r->mesh, p[0], -p[2], p[1]);
    return true;
}

/* A corner is v, v/t, v//n or v/t/n; a negative v counts from the last vertex. */
static bool read_face(const struct obj_reader *r, char *text) {
    uint32_t corners[3];
    int count = 0;
    for (char *corner = strtok(text, " \t\r\n"); corner; corner = strtok(NULL, " \t\r\n")) {
        char *end;
        const long number = strtol(corner, &end, 10);
        if (end == corner || (*end && *end != '/'))
            return fail(r, "a face's corner is not a number");
        const long index = number < 0 ? (long)r->mesh->vertex_count + number : number - 1;
        if (index < 0 || index >= (long)r->mesh->vertex_count)
            return fail(r, "a face names a vertex that is not there");
        corners[count < 2 ? count : 2] = (uint32_t)index;
        if (++count < 3)
            continue;
        mesh_add_triangle(r->mesh, corners[0], corners[1], corners[2]);
        corners[1] = corners[2];
    }
    return true;
}

static bool read_lines(struct obj_reader *r, FILE *file) {
    char line[LINE_BYTES];
    while (fgets(line, sizeof line, file)) {
        r->line++;
        if (!strchr(line, '\n') && !feof(file))
            return fail(r, "the line is too long");
        if (strncmp(line, "v ", 2) == 0) {
            if (!read_vertex(r, line + 2))
                return false;
        } else if (strncmp(line, "f ", 2) == 0) {
            if (!read_face(r, line + 2))
                return false;
        }
    }
    if (ferror(file))
        return fail_file(r, strerror(errno));
    return r->mesh->triangle_count || fail_file(r, "there is no face in this file");
}

bool obj_load(const char *path, struct mesh *mesh, char *message, size_t capacity) {
    struct obj_reader reader = {mesh, path, 0, message, capacity};
    FILE *file = fopen(path, "r");
    mesh_init(mesh);
    if (!file)
        return fail_file(&reader, strerror(errno));
    const bool done = read_lines(&reader, file);
    fclose(file);
    if (!done)
        mesh_free(mesh);
    return done;
}
