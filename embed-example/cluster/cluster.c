/*
 * Renders one picture on many machines: croupier shares nothing but bytes, MPI carries them.
 *
 *     mpicc -std=c99 cluster.c $(pkg-config --cflags --libs croupier) -o cluster
 *     mpirun -n 8 ./cluster box.crp box.ppm
 *     mpirun -n 8 ./cluster SCENE.crp PICTURE.ppm 60 16 16 32     # seconds of silence, samples per pixel of iterations
 *
 * Every process has a whole session, and a handle for every shard. In each iteration it renders the shards that are its
 * own, sends them to all others, loads theirs, and ends the iteration alone: all have the same picture and have learned the
 * same, to the bit. So any process can stand in for any other, and nobody has to agree on who is still there: whoever
 * misses a shard for too long takes its owner for dead, divides its shards among the others, and in the end renders them
 * itself. Being wrong about that costs time, never the picture. What MPI makes of dead processes is in docs/CLUSTER.md.
 */
#define _POSIX_C_SOURCE 200112L
#include <croupier.h>
#include <errno.h>
#include <limits.h>
#include <mpi.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define SHARDS 8 /* as many as there will ever be processes, or more: the picture depends on their number */

static croupier_message m;
static int rank, ranks;
static int *dead, failed; /* which processes this one has given up, and how many */
static double patience = 60; /* seconds */

static void check(croupier_status status)
{
    if (status != CROUPIER_OK) {
        fprintf(stderr, "rank %d: croupier: %s\n", rank, m.text[0] ? m.text : croupier_status_text(status));
        MPI_Abort(MPI_COMM_WORLD, 1);
    }
}

static void *block(size_t bytes)
{
    void *memory = NULL;
    if (posix_memalign(&memory, CROUPIER_ALIGN, bytes)) {
        fprintf(stderr, "rank %d: no %lu bytes of memory\n", rank, (unsigned long)bytes);
        MPI_Abort(MPI_COMM_WORLD, 1);
    }
    return memory;
}

/* A number of the command line, with a fraction or without. */
static double number(const char *text, double low, double high, int whole)
{
    char *end = NULL;
    double value;
    errno = 0;
    value = strtod(text, &end);
    if (errno || end == text || *end || !(value >= low && value <= high) || (whole && value != (double)(long)value)) {
        fprintf(stderr, "rank %d: '%s' is no %s from %g to %g\n", rank, text, whole ? "whole number" : "number", low,
                high);
        MPI_Abort(MPI_COMM_WORLD, 2);
    }
    return value;
}

static void *read_file(const char *path, size_t *bytes)
{
    FILE *file = fopen(path, "rb");
    long end = -1;
    void *data;
    if (!file || fseek(file, 0, SEEK_END) || (end = ftell(file)) < 0 || fseek(file, 0, SEEK_SET)) {
        perror(path);
        MPI_Abort(MPI_COMM_WORLD, 1);
    }
    *bytes = (size_t)end;
    data = block(*bytes + 1);
    if (fread(data, 1, *bytes, file) != *bytes) {
        perror(path);
        MPI_Abort(MPI_COMM_WORLD, 1);
    }
    fclose(file);
    return data;
}

/* The process that renders a shard: those that live take turns. */
static int owner(int shard)
{
    int r, living = 0, turn;
    for (r = 0; r < ranks; r++)
        living += !dead[r];
    turn = shard % living;
    for (r = 0; r < ranks; r++)
        if (!dead[r] && turn-- == 0)
            break;
    return r;
}

static void give_up(int r, const char *why)
{
    if (!dead[r])
        fprintf(stderr, "rank %d: rank %d %s: its shards go to others\n", rank, r, why);
    failed += !dead[r];
    dead[r] = 1;
}

#ifndef TAGS
#define TAGS 32767 /* that all implementations of MPI have */
#endif
#define WRITTEN TAGS /* tag of the message that the picture is there */

/* Messages of one iteration are told from those of others by their tags. After TAGS / SHARDS iterations tags come
 * again: then the iteration that ends each message tells. */
static int tag(uint32_t iteration, int shard)
{
    return (int)(((uint64_t)iteration * SHARDS + (uint64_t)shard) % TAGS);
}

/* Messages on their way to all other processes. */
static struct sending {
    struct sending *next;
    void *bytes;
    MPI_Request *requests;
} *outgoing;

static MPI_Request *no_requests(void)
{
    MPI_Request *requests = block(sizeof(MPI_Request) * (size_t)ranks);
    int r;
    for (r = 0; r < ranks; r++)
        requests[r] = MPI_REQUEST_NULL;
    return requests;
}

/* Have all of these arrived? */
static int arrived(MPI_Request *requests)
{
    int r, done, all = 1;
    for (r = 0; r < ranks; r++)
        all &= MPI_Test(&requests[r], &done, MPI_STATUS_IGNORE) == MPI_SUCCESS && done;
    return all;
}

static int all_arrived(void)
{
    struct sending *s;
    int all = 1;
    for (s = outgoing; s; s = s->next)
        all &= arrived(s->requests);
    return all;
}

static size_t send(croupier_shard *handle, uint32_t iteration, int shard, size_t most)
{
    size_t bytes;
    struct sending *s = outgoing;
    int r;
    /* What somebody has not taken yet stays where it is, for good if he is dead: MPI may still read it. */
    while (s && !arrived(s->requests))
        s = s->next;
    if (!s) {
        s = block(sizeof *s);
        s->next = outgoing;
        s->bytes = block(most + sizeof iteration);
        s->requests = no_requests();
        outgoing = s;
    }
    check(croupier_shard_save(handle, s->bytes, most, &bytes, &m));
    memcpy((char *)s->bytes + bytes, &iteration, sizeof iteration);
    for (r = 0; r < ranks; r++)
        if (r != rank && !dead[r])
            MPI_Isend(s->bytes, (int)(bytes + sizeof iteration), MPI_BYTE, r, tag(iteration, shard), MPI_COMM_WORLD,
                      &s->requests[r]);
    return bytes;
}

/* Takes a message about a shard, if there is one; 1 if it was loaded. Without a handle it is thrown away. */
static int receive(croupier_shard *handle, croupier_session *session, uint32_t iteration, int shard, void **buffer,
                   size_t most)
{
    const int message_tag = tag(iteration, shard);
    const size_t end = sizeof iteration;
    MPI_Request request;
    MPI_Status status;
    int found = 0, bytes = 0, done = 0;
    double begun = MPI_Wtime();
    if (MPI_Iprobe(MPI_ANY_SOURCE, message_tag, MPI_COMM_WORLD, &found, &status) != MPI_SUCCESS || !found)
        return 0;
    MPI_Get_count(&status, MPI_BYTE, &bytes);
    /* The announcement is here; its sender may have stopped in the middle of the message. */
    MPI_Irecv(*buffer, (int)(most + end), MPI_BYTE, status.MPI_SOURCE, message_tag, MPI_COMM_WORLD, &request);
    while (!done && MPI_Wtime() - begun < patience)
        if (MPI_Test(&request, &done, MPI_STATUS_IGNORE) != MPI_SUCCESS)
            break;
    if (!done) {
        give_up(status.MPI_SOURCE, "stopped in the middle of a message");
        *buffer = block(most + end); /* the old one may yet be written to */
        return 0;
    }
    /* Of an earlier iteration: a shard that two have rendered, and that came late the second time. */
    if (!handle || (size_t)bytes < end || memcmp((char *)*buffer + bytes - end, &iteration, end))
        return 0;
    if (croupier_shard_load(handle, session, *buffer, (size_t)bytes - end, &m) == CROUPIER_OK)
        return 1;
    fprintf(stderr, "rank %d: from rank %d: %s\n", rank, status.MPI_SOURCE, m.text);
    give_up(status.MPI_SOURCE, "sends what does not belong");
    return 0;
}

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

/* Square roots in place of the sRGB curve. The picture gets its name when it is complete: this process may be taken for
 * dead and ended while it writes, and another may write the same picture. */
static void write_ppm(const char *path, const float *rgb, uint32_t width, uint32_t height)
{
    size_t i, n = (size_t)width * height * 3, length = strlen(path) + 32;
    char *unfinished = block(length);
    FILE *file;
    int failed_writes;
    snprintf(unfinished, length, "%s.%d.part", path, rank);
    file = fopen(unfinished, "wb");
    if (!file) {
        perror(unfinished);
        MPI_Abort(MPI_COMM_WORLD, 1);
    }
    fprintf(file, "P6\n%u %u\n255\n", (unsigned)width, (unsigned)height);
    for (i = 0; i < n; i++) {
        int y = 0;
        while (y < 255 && (float)(y + 1) * (float)(y + 1) <= rgb[i] * 65025.0f)
            y++;
        fputc(y, file);
    }
    failed_writes = ferror(file);
    /* The last bytes may fail only here. */
    failed_writes |= fclose(file);
    if (failed_writes || rename(unfinished, path)) {
        perror(path);
        remove(unfinished);
        MPI_Abort(MPI_COMM_WORLD, 1);
    }
    free(unfinished);
}

int main(int argc, char **argv)
{
    static const char *const texts[][2] = {
        {"rrs", "ears"}, {"ring", "64"}, {"ledger", "256"}, {"cache-bytes", "65536"},
        {"split-budget", "64"}, {"pixel-estimator", "blocks"},
    };
    static const char *const usual[] = {"2", "2", "4"};
    const struct timespec pause = {0, 200000};
    croupier_settings settings;
    croupier_plan plan;
    croupier_sizes sizes = {.struct_size = sizeof sizes};
    croupier_scene *scene;
    croupier_session *session;
    croupier_shard *shards[SHARDS];
    size_t k, bytes, floats, most = 0;
    uint32_t n;
    int i, r, done = 0;

    MPI_Init(&argc, &argv);
    MPI_Comm_set_errhandler(MPI_COMM_WORLD, MPI_ERRORS_RETURN);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    if (argc < 3 || argc == 4) {
        fprintf(stderr, "usage: %s SCENE.crp PICTURE.ppm [PATIENCE SAMPLES...]\n", argv[0]);
        MPI_Abort(MPI_COMM_WORLD, 2);
    }
    const char *const *samples = argc > 4 ? (const char *const *)argv + 4 : usual;
    const uint32_t iterations = argc > 4 ? (uint32_t)argc - 4 : 3;
    for (n = 0; n < iterations; n++)
        number(samples[n], 1, 65536, 1);
    patience = argc > 4 ? number(argv[3], 0.001, 1e6, 0) : patience;
    dead = block(sizeof(int) * (size_t)ranks);
    memset(dead, 0, sizeof(int) * (size_t)ranks);

    check(croupier_check_processor(&m));
    void *blob = read_file(argv[1], &bytes), *scene_block = block(CROUPIER_SCENE_BYTES);
    check(croupier_scene_init(scene_block, CROUPIER_SCENE_BYTES, blob, bytes, &scene, &m));
    check(croupier_settings_init(&settings, scene, &m));
    for (k = 0; k < sizeof texts / sizeof texts[0]; k++)
        check(croupier_settings_set(&settings, texts[k][0], texts[k][1], &m));
    check(croupier_settings_set_shards(&settings, SHARDS, &m));
    check(croupier_plan_init(&plan, &settings, &m));
    check(croupier_plan_sizes(&plan, &sizes, &m));
    check(croupier_session_init(block(sizes.session), sizes.session, &plan, scene, &session, &m));
    for (i = 0; i < SHARDS; i++) {
        /* Pages that are never touched cost nothing: shards of others use those of their sums. */
        check(croupier_plan_shard_size(&plan, (uint32_t)i, &bytes, &m));
        check(croupier_shard_init(block(bytes), bytes, &plan, (uint32_t)i, &shards[i], &m));
        check(croupier_plan_saved_shard_size(&plan, (uint32_t)i, &bytes, &m));
        most = bytes > most ? bytes : most;
    }
    if (most > INT_MAX - sizeof n) {
        fprintf(stderr, "shards of %lu bytes are too large for a message: more SHARDS\n", (unsigned long)most);
        MPI_Abort(MPI_COMM_WORLD, 1);
    }
    void *buffer = block(most + sizeof n);

    for (n = 0; n < iterations; n++) {
        int have[SHARDS] = {0}, missing = SHARDS;
        size_t exchanged = 0;
        double last;
        uint32_t more;
        check(croupier_session_begin_iteration(session, (uint32_t)number(samples[n], 1, 65536, 1), &m));
        while (missing) {
            for (i = 0; i < SHARDS; i++)
                if (!have[i] && owner(i) == rank) {
                    do
                        check(croupier_shard_step(shards[i], session, 100000, &more, &m));
                    while (more);
                    exchanged += send(shards[i], n, i, most);
                    have[i] = 1, missing--;
                }
            const int before = failed;
            last = MPI_Wtime();
            while (missing && failed == before && MPI_Wtime() - last < patience) {
                for (i = 0; i < SHARDS && failed == before; i++)
                    if (!have[i] && receive(shards[i], session, n, i, &buffer, most)) {
                        have[i] = 1, missing--;
                        last = MPI_Wtime();
                    }
                nanosleep(&pause, NULL);
            }
            /* Nothing for a long time. All that are silent, before any of their shards changes hands. */
            int silent[SHARDS];
            for (i = 0; i < SHARDS; i++)
                silent[i] = have[i] || failed != before ? rank : owner(i);
            for (i = 0; i < SHARDS; i++)
                if (silent[i] != rank)
                    give_up(silent[i], "is silent");
        }
        do
            check(croupier_session_finish_iteration(session, shards, SHARDS, 1000000, &more, &m));
        while (more);
        for (i = 0; n > 0 && i < SHARDS; i++) /* shards that two have rendered come twice */
            receive(NULL, session, n - 1, i, &buffer, most);
        fprintf(stderr, "rank %d: iteration %lu sent %lu bytes to each other\n", rank, (unsigned long)n + 1,
                (unsigned long)exchanged);
    }

    floats = (size_t)sizes.width * sizes.height * 3;
    float *rgb = block(floats * sizeof *rgb);
    check(croupier_session_rgb(session, rgb, floats, &m));
    /* The first that lives writes the picture, and says so; any other has the same. */
    MPI_Request heard, *said = no_requests();
    double last;
    while (owner(0) != rank && !done) {
        const int writer = owner(0);
        MPI_Irecv(NULL, 0, MPI_BYTE, writer, WRITTEN, MPI_COMM_WORLD, &heard);
        for (last = MPI_Wtime(); !done && MPI_Wtime() - last < patience; nanosleep(&pause, NULL)) {
            MPI_Test(&heard, &done, MPI_STATUS_IGNORE);
            all_arrived();
        }
        if (!done)
            give_up(writer, "is silent");
    }
    if (owner(0) == rank) {
        const uint64_t h = hash(rgb, floats);
        write_ppm(argv[2], rgb, sizes.width, sizes.height);
        printf("%08lx%08lx\n", (unsigned long)(h >> 32), (unsigned long)(h & 0xffffffffu));
        fflush(stdout);
        for (r = 0; r < ranks; r++)
            if (r != rank && !dead[r])
                MPI_Isend(NULL, 0, MPI_BYTE, r, WRITTEN, MPI_COMM_WORLD, &said[r]);
    }
    /* MPI ends in order if every message has arrived, and cannot without the dead. */
    for (done = 0, last = MPI_Wtime(); !failed && !done && MPI_Wtime() - last < patience; nanosleep(&pause, NULL))
        done = all_arrived() & arrived(said);
    /* Otherwise: the picture is there, nobody has to wait for anybody. */
    if (!done)
        MPI_Abort(MPI_COMM_WORLD, 0);
    return MPI_Finalize() != MPI_SUCCESS;
}
