/*
 * Renders a baked scene with croupier and writes it as a picture: a complete program in C99.
 *
 *     cc box.c $(pkg-config --cflags --libs croupier) -o box
 *     ./box box.crp box.ppm
 *
 * The last line that it prints is a hash of the picture, the same on every machine (embed-example/hashes.txt, A).
 */
#define _POSIX_C_SOURCE 200112L
#include <croupier.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

/* Ends the program with the library's own words if a call fails. */
static void check(croupier_status status, const croupier_message *message)
{
    if (status != CROUPIER_OK) {
        fprintf(stderr, "croupier: %s\n", message->text[0] ? message->text : croupier_status_text(status));
        exit(1);
    }
}

/* Blocks of the library start at multiples of CROUPIER_ALIGN; what is in them before does not matter. */
static void *block(size_t bytes)
{
    void *memory = NULL;
    if (posix_memalign(&memory, CROUPIER_ALIGN, bytes)) {
        fprintf(stderr, "no %lu bytes of memory\n", (unsigned long)bytes);
        exit(1);
    }
    return memory;
}

static void *read_file(const char *path, size_t *bytes)
{
    FILE *file = fopen(path, "rb");
    long end;
    void *data;
    if (!file || fseek(file, 0, SEEK_END) || (end = ftell(file)) < 0 || fseek(file, 0, SEEK_SET)) {
        perror(path);
        exit(1);
    }
    *bytes = (size_t)end;
    data = block(*bytes + 1);
    if (fread(data, 1, *bytes, file) != *bytes) {
        perror(path);
        exit(1);
    }
    fclose(file);
    return data;
}

/* A linear value as a byte of an sRGB picture, nearly: square root in place of the curve. */
static unsigned char tone(float x)
{
    int y = 0;
    while (y < 255 && (float)(y + 1) * (float)(y + 1) <= x * 65025.0f)
        y++;
    return (unsigned char)y;
}

static void write_ppm(const char *path, const float *rgb, uint32_t width, uint32_t height)
{
    size_t i, n = (size_t)width * height * 3;
    FILE *file = fopen(path, "wb");
    if (!file) {
        perror(path);
        exit(1);
    }
    fprintf(file, "P6\n%u %u\n255\n", (unsigned)width, (unsigned)height);
    for (i = 0; i < n; i++)
        fputc(tone(rgb[i]), file);
    /* what is still in memory may fail to be written, too */
    if (ferror(file) | fclose(file)) {
        perror(path);
        exit(1);
    }
}

/* 64-bit FNV-1a of the numbers as little-endian bytes. */
static uint64_t hash(const float *values, size_t count)
{
    uint64_t h = UINT64_C(0xcbf29ce484222325);
    size_t i;
    int byte;
    for (i = 0; i < count; i++) {
        union { float number; uint32_t bits; } v;
        v.number = values[i];
        for (byte = 0; byte < 4; byte++)
            h = (h ^ (v.bits >> 8 * byte & 0xff)) * UINT64_C(0x100000001b3);
    }
    return h;
}

int main(int argc, char **argv)
{
    static const char *const texts[][2] = {
        {"rrs", "ears"}, {"ring", "64"}, {"ledger", "256"}, {"cache-bytes", "65536"},
        {"split-budget", "64"}, {"pixel-estimator", "blocks"},
    };
    static const uint32_t samples[] = {2, 2, 4};
    croupier_message m;
    croupier_settings settings;
    croupier_plan plan;
    croupier_sizes sizes = {.struct_size = sizeof sizes};
    croupier_error_estimate estimate = {.struct_size = sizeof estimate};
    croupier_scene *scene;
    croupier_session *session;
    croupier_shard *shard;
    size_t i, bytes, floats;
    float *rgb;

    if (argc != 3) {
        fprintf(stderr, "usage: %s SCENE.crp PICTURE.ppm\n", argv[0]);
        return 2;
    }
    check(croupier_check_processor(&m), &m);
    fprintf(stderr, "croupier %s, %s\n", croupier_version(), croupier_instruction_set());

    /* The scene stays in the bytes of the file; they must stay too. */
    void *blob = read_file(argv[1], &bytes), *scene_block = block(CROUPIER_SCENE_BYTES);
    check(croupier_scene_init(scene_block, CROUPIER_SCENE_BYTES, blob, bytes, &scene, &m), &m);

    /* What to render, and how much memory that takes. */
    check(croupier_settings_init(&settings, scene, &m), &m);
    for (i = 0; i < sizeof texts / sizeof texts[0]; i++)
        check(croupier_settings_set(&settings, texts[i][0], texts[i][1], &m), &m);
    check(croupier_plan_init(&plan, &settings, &m), &m);
    check(croupier_plan_sizes(&plan, &sizes, &m), &m);

    /* All memory, once. */
    void *session_block = block(sizes.session), *shard_block = block(sizes.shard);
    check(croupier_session_init(session_block, sizes.session, &plan, scene, &session, &m), &m);
    check(croupier_shard_init(shard_block, sizes.shard, &plan, 0, &shard, &m), &m);

    for (i = 0; i < sizeof samples / sizeof samples[0]; i++) {
        uint32_t more;
        check(croupier_session_begin_iteration(session, samples[i], &m), &m);
        do /* a bounded piece of work: show the picture, answer the user in between */
            check(croupier_shard_step(shard, session, 1000, &more, &m), &m);
        while (more);
        do
            check(croupier_session_finish_iteration(session, &shard, 1, 1000, &more, &m), &m);
        while (more);
    }

    floats = (size_t)sizes.width * sizes.height * 3;
    rgb = malloc(floats * sizeof *rgb);
    if (!rgb)
        return 1;
    check(croupier_session_rgb(session, rgb, floats, &m), &m);
    check(croupier_session_error_estimate(session, &estimate, &m), &m);
    fprintf(stderr, "%u x %u pixels, ", (unsigned)sizes.width, (unsigned)sizes.height);
    if (estimate.resolved)
        fprintf(stderr, "estimated relMSE %.3f (%.3f to %.3f)\n", estimate.rel_mse, estimate.low, estimate.high);
    else
        fprintf(stderr, "relMSE of at least %.3f\n", estimate.rel_mse);
    write_ppm(argv[2], rgb, sizes.width, sizes.height);
    printf("%08lx%08lx\n", (unsigned long)(hash(rgb, floats) >> 32), (unsigned long)(hash(rgb, floats) & 0xffffffffu));

    /* Objects own nothing but their memory: to end one is to say that its handle is dead. */
    check(croupier_shard_destroy(shard, &m), &m);
    check(croupier_session_destroy(session, &m), &m);
    check(croupier_scene_destroy(scene, &m), &m);
    free(rgb);
    free(shard_block);
    free(session_block);
    free(scene_block);
    free(blob);
    return 0;
}
