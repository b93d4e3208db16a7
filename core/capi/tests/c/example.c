/*
 * The example of README.md and docs/C.md, which is compiled beside this: renders a scene, and returns 1 whichever of its
 * three loops fails. Linked with --wrap for these calls.
 *
 *     example SCENE.crp
 */
#define _POSIX_C_SOURCE 200112L
#include <croupier.h>
#include <stdio.h>
#include <stdlib.h>

int render(void *blob, size_t bytes, float *rgb, size_t floats, void *(*block)(size_t));

/* Which call fails: 1, 2, 3; 0 for none. */
static int failing;

croupier_status __real_croupier_session_begin_iteration(croupier_session *, uint32_t, croupier_message *);
croupier_status __real_croupier_shard_step(croupier_shard *, const croupier_session *, uint64_t, uint32_t *, croupier_message *);
croupier_status __real_croupier_session_finish_iteration(croupier_session *, croupier_shard *const *, size_t, uint64_t,
                                                         uint32_t *, croupier_message *);
croupier_status __wrap_croupier_session_begin_iteration(croupier_session *, uint32_t, croupier_message *);
croupier_status __wrap_croupier_shard_step(croupier_shard *, const croupier_session *, uint64_t, uint32_t *, croupier_message *);
croupier_status __wrap_croupier_session_finish_iteration(croupier_session *, croupier_shard *const *, size_t, uint64_t,
                                                         uint32_t *, croupier_message *);

croupier_status __wrap_croupier_session_begin_iteration(croupier_session *session, uint32_t samples, croupier_message *m)
{
    return failing == 1 ? CROUPIER_BUSY : __real_croupier_session_begin_iteration(session, samples, m);
}

croupier_status __wrap_croupier_shard_step(croupier_shard *shard, const croupier_session *session, uint64_t rays,
                                           uint32_t *more, croupier_message *m)
{
    *more = 0;
    return failing == 2 ? CROUPIER_BUSY : __real_croupier_shard_step(shard, session, rays, more, m);
}

croupier_status __wrap_croupier_session_finish_iteration(croupier_session *session, croupier_shard *const *shards,
                                                         size_t count, uint64_t units, uint32_t *more, croupier_message *m)
{
    *more = 0;
    return failing == 3 ? CROUPIER_BUSY : __real_croupier_session_finish_iteration(session, shards, count, units, more, m);
}

static void *block(size_t bytes)
{
    void *memory = NULL;
    if (posix_memalign(&memory, CROUPIER_ALIGN, bytes)) exit(3);
    return memory;
}

int main(int argc, char **argv)
{
    static float rgb[64 * 64 * 3];
    enum { ROOM = 1 << 20 };
    FILE *file = argc == 2 ? fopen(argv[1], "rb") : NULL;
    void *blob = block(ROOM);
    size_t bytes = file ? fread(blob, 1, ROOM, file) : 0, i;
    double sum = 0;
    if (!bytes) return 2;
    if (render(blob, bytes, rgb, sizeof rgb / sizeof *rgb, block)) return 4;
    for (i = 0; i < sizeof rgb / sizeof *rgb; i++) sum += rgb[i];
    if (!(sum / (double)i > 0.05)) return 5; /* black */
    for (failing = 1; failing <= 3; failing++)
        if (!render(blob, bytes, rgb, sizeof rgb / sizeof *rgb, block)) {
            fprintf(stderr, "the failure of call %d is not noticed\n", failing);
            return 6;
        }
    return 0;
}
