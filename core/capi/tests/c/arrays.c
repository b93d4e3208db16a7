/*
 * A program that brings triangles at run time, traces rays with an intersector of its own, and edits the scene between
 * pictures. The last line that it prints is a hash of the picture, the same on every machine (hashes.txt, C).
 */
#define _POSIX_C_SOURCE 200112L
#include <croupier.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { SIZE = 32, FLOATS = 3 * SIZE * SIZE, ROOM = 16 };

static croupier_message message;

static void check(croupier_status status, const char *what)
{
    if (status != CROUPIER_OK) {
        fprintf(stderr, "%s: %s\n", what, message.text);
        exit(1);
    }
}

static void require(int holds, const char *what)
{
    if (!holds) {
        fprintf(stderr, "wrong: %s\n", what);
        exit(1);
    }
}

static void *block(size_t bytes)
{
    void *memory = NULL;
    require(!posix_memalign(&memory, CROUPIER_ALIGN, bytes), "memory");
    return memory;
}

/* An intersector: every ray with every triangle, in double precision, of the corners that the scene tells. */
struct mesh {
    size_t count;
    float corners[ROOM][3][3];
    unsigned long calls;
};

static void cross(const double a[3], const double b[3], double to[3])
{
    to[0] = a[1] * b[2] - a[2] * b[1];
    to[1] = a[2] * b[0] - a[0] * b[2];
    to[2] = a[0] * b[1] - a[1] * b[0];
}

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* Moeller and Trumbore. */
static int meets(float corners[3][3], const croupier_rays8 *rays, int lane, float limit, float *t, float *u, float *v)
{
    double e[3], f[3], s[3], d[3], p[3], q[3], det, a, b, c;
    int k;
    for (k = 0; k < 3; k++) {
        e[k] = (double)corners[1][k] - corners[0][k];
        f[k] = (double)corners[2][k] - corners[0][k];
        s[k] = (double)rays->origin[k][lane] - corners[0][k];
        d[k] = rays->direction[k][lane];
    }
    cross(d, f, p);
    det = dot(e, p);
    if (det == 0.0) return 0;
    cross(s, e, q);
    a = dot(s, p) / det;
    b = dot(d, q) / det;
    c = dot(f, q) / det;
    if (a < 0.0 || b < 0.0 || a + b > 1.0 || c <= rays->tmin[lane] || c >= limit) return 0;
    *t = (float)c;
    *u = (float)a;
    *v = (float)b;
    return 1;
}

static uint32_t closest(void *user, const croupier_rays8 *rays, uint32_t active, croupier_hits8 *hits)
{
    struct mesh *mesh = user;
    uint32_t hit = 0, lane;
    size_t i;
    mesh->calls++;
    for (lane = 0; lane < 8; lane++)
        for (i = 0; active >> lane & 1 && i < mesh->count; i++)
            if (meets(mesh->corners[i], rays, (int)lane, hit >> lane & 1 ? hits->t[lane] : rays->tmax[lane],
                      &hits->t[lane], &hits->u[lane], &hits->v[lane])) {
                hit |= UINT32_C(1) << lane;
                hits->triangle[lane] = (uint32_t)i;
            }
    return hit;
}

static uint32_t occluded(void *user, const croupier_rays8 *rays, uint32_t active)
{
    struct mesh *mesh = user;
    uint32_t hit = 0, lane;
    float t, u, v;
    size_t i;
    for (lane = 0; lane < 8; lane++)
        for (i = 0; active >> lane & 1 && i < mesh->count; i++)
            if (meets(mesh->corners[i], rays, (int)lane, rays->tmax[lane], &t, &u, &v)) hit |= UINT32_C(1) << lane;
    return hit;
}

/* One picture: two iterations, of all shards (one). */
static void picture(croupier_session *session, croupier_shard *shard, float *rgb)
{
    int i;
    for (i = 0; i < 2; i++) {
        uint32_t more = 1;
        check(croupier_session_begin_iteration(session, 4, &message), "begin");
        while (more) check(croupier_shard_step(shard, session, 1000, &more, &message), "step");
        do check(croupier_session_finish_iteration(session, &shard, 1, 1000, &more, &message), "finish"); while (more);
    }
    check(croupier_session_rgb(session, rgb, FLOATS, &message), "rgb");
}

static uint64_t hash(const float *values)
{
    uint64_t h = UINT64_C(0xcbf29ce484222325);
    size_t i;
    int byte;
    for (i = 0; i < FLOATS; i++) {
        union { float number; uint32_t bits; } v;
        v.number = values[i];
        for (byte = 0; byte < 4; byte++) h = (h ^ (v.bits >> 8 * byte & 0xff)) * UINT64_C(0x100000001b3);
    }
    return h;
}

static double mean(const float *rgb, int channel)
{
    double sum = 0;
    int i;
    for (i = channel; i < FLOATS; i += 3) sum += rgb[i];
    return sum / (SIZE * SIZE);
}

int main(void)
{
    /* a floor, a wall behind it, and a lamp that shines down */
    static const float positions[][3] = {{-2, 0, -2}, {2, 0, -2}, {2, 0, 2}, {-2, 0, 2}, {-2, 3, -2}, {2, 3, -2},
                                         {-0.5f, 2.9f, -0.5f}, {0.5f, 2.9f, -0.5f}, {0.5f, 2.9f, 0.5f}, {-0.5f, 2.9f, 0.5f}};
    /* the second one has no area and is left out: those behind it have other numbers in the scene */
    static const uint32_t triangles[][3] = {{0, 2, 1}, {1, 1, 5}, {0, 3, 2}, {0, 1, 5}, {0, 5, 4}, {6, 7, 8}, {6, 8, 9}};
    static const uint32_t kinds[] = {0, 0, 0, 1, 1, 2, 2};
    static const float emission[3][3] = {{0, 0, 0}, {0, 0, 0}, {9, 9, 9}};
    static struct mesh mesh;
    static float first[FLOATS], rgb[FLOATS];
    croupier_material materials[3], plastic, red;
    croupier_view view = {.struct_size = sizeof view, .kind = CROUPIER_PERSPECTIVE, .origin = {0, 1.5, 6},
                          .target = {0, 1.2, 0}, .up = {0, 1, 0}, .extent = 40, .width = SIZE, .height = SIZE};
    croupier_camera camera = {.struct_size = sizeof camera};
    croupier_scene_facts facts = {.struct_size = sizeof facts};
    croupier_settings settings;
    croupier_plan plan;
    croupier_sizes sizes = {.struct_size = sizeof sizes};
    croupier_parts parts = {.struct_size = sizeof parts, .user = &mesh, .closest = closest, .occluded = occluded};
    croupier_scene *scene;
    croupier_session *session, *own;
    croupier_shard *shard, *other;
    size_t blob_size, scratch_size, length, needed;
    uint64_t expected;
    float *tables;
    int i;

    for (i = 0; i < 3; i++) {
        check(croupier_material_init(&materials[i], i == 1 ? CROUPIER_ROUGH_PLASTIC : CROUPIER_DIFFUSE, &message), "kind");
        materials[i].reflectance[0] = materials[i].reflectance[1] = materials[i].reflectance[2] = 0.5f;
    }
    materials[1].alpha = 0.3f;
    materials[1].eta[0] = 1.5f;
    check(croupier_camera_from_view(&view, &camera, &message), "view");
    croupier_arrays arrays = {.struct_size = sizeof arrays, .camera = &camera,
                              .positions = positions, .vertices = sizeof positions / sizeof *positions,
                              .triangles = triangles, .triangle_materials = kinds,
                              .triangle_count = sizeof triangles / sizeof *triangles,
                              .materials = materials, .emission = emission, .material_count = 3,
                              .surround = CROUPIER_SURROUND_CONSTANT, .radiance = {0.1f, 0.1f, 0.1f}};
    check(croupier_scene_compose_size(&arrays, &blob_size, &scratch_size, &message), "sizes");
    void *blob = block(blob_size), *scratch = block(scratch_size), *scene_block = block(CROUPIER_SCENE_BYTES);
    require(croupier_scene_compose(&arrays, blob, blob_size, blob, blob_size, &length, &message) == CROUPIER_OVERLAP,
            "scratch in the blob");
    check(croupier_scene_compose(&arrays, blob, blob_size, scratch, scratch_size, &length, &message), "compose");
    free(scratch);
    check(croupier_scene_init(scene_block, CROUPIER_SCENE_BYTES, blob, length, &scene, &message), "scene");

    check(croupier_scene_info(scene, &facts, &message), "facts");
    mesh.count = facts.triangles;
    require(mesh.count == arrays.triangle_count - 1, "one triangle is left out");
    check(croupier_scene_triangles(scene, 0, mesh.count, mesh.corners, NULL, &message), "triangles");

    check(croupier_settings_init(&settings, scene, &message), "settings");
    check(croupier_settings_set(&settings, "rrs", "ears", &message), "rrs");
    check(croupier_settings_set(&settings, "pixel-estimator", "blocks", &message), "estimator");
    check(croupier_settings_set(&settings, "cache-bytes", "65536", &message), "cache");
    check(croupier_plan_init(&plan, &settings, &message), "plan");
    check(croupier_plan_sizes(&plan, &sizes, &message), "sizes");
    void *blocks[4] = {block(sizes.session), block(sizes.shard), block(sizes.session), block(sizes.shard)};
    check(croupier_session_init(blocks[0], sizes.session, &plan, scene, &session, &message), "session");
    check(croupier_shard_init(blocks[1], sizes.shard, &plan, 0, &shard, &message), "shard");
    check(croupier_session_init_with(blocks[2], sizes.session, &plan, scene, &parts, &own, &message), "own session");
    check(croupier_shard_init(blocks[3], sizes.shard, &plan, 0, &other, &message), "own shard");

    /* the same random numbers: the pictures differ where roundings decide */
    picture(session, shard, first);
    expected = hash(first);
    picture(own, other, rgb);
    require(mesh.calls > 100, "the intersector is called");
    for (i = 0; i < 3; i++) {
        fprintf(stderr, "channel %d: %.5f, and %.5f with the program's intersector\n", i, mean(first, i), mean(rgb, i));
        require(mean(first, i) > 0.05 && fabs(mean(rgb, i) / mean(first, i) - 1.0) < 0.01, "one picture by two intersectors");
    }

    /* the wall gets another colour, with the tables that it has, and then the old one again */
    check(croupier_scene_material_tables(scene, 1, NULL, 0, &needed, &message), "number of tables");
    require(needed > 0, "rough plastics have tables");
    tables = malloc(needed * sizeof *tables);
    require(tables != NULL, "memory");
    check(croupier_scene_material_tables(scene, 1, tables, needed, NULL, &message), "tables");
    check(croupier_scene_material(scene, 1, &plastic, &message), "material");
    red = plastic;
    red.reflectance[0] = 0.9f;
    red.reflectance[1] = red.reflectance[2] = 0.1f;
    check(croupier_scene_set_material(scene, 1, &red, tables, needed, &message), "red");
    require(croupier_shard_step(shard, session, 1, &(uint32_t){0}, &message) == CROUPIER_SCENE_CHANGED, "a stale session");
    check(croupier_session_change_scene(session, scene, 0, &message), "change");
    picture(session, shard, rgb);
    fprintf(stderr, "a red wall: %.5f %.5f %.5f\n", mean(rgb, 0), mean(rgb, 1), mean(rgb, 2));
    require(mean(rgb, 0) > 1.02 * mean(first, 0) && mean(rgb, 1) < 0.98 * mean(first, 1), "a red wall");
    check(croupier_scene_set_material(scene, 1, &plastic, tables, needed, &message), "grey");
    check(croupier_session_change_scene(session, scene, 0, &message), "change back");
    picture(session, shard, rgb);
    require(hash(rgb) == expected, "the old picture, to the bit");
    printf("%08lx%08lx\n", (unsigned long)(expected >> 32), (unsigned long)(expected & 0xffffffffu));

    check(croupier_shard_destroy(other, &message), "shard");
    check(croupier_session_destroy(own, &message), "session");
    check(croupier_shard_destroy(shard, &message), "shard");
    check(croupier_session_destroy(session, &message), "session");
    check(croupier_scene_destroy(scene, &message), "scene");
    for (i = 0; i < 4; i++) free(blocks[i]);
    free(tables);
    free(scene_block);
    free(blob);
    return 0;
}
