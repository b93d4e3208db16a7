/*
 * Traces given rays with Embree 4. The benchmark `traversal --embree LIBRARY` compiles this file and starts it:
 *
 *     rays LIBRARY DEVICE...          a device's configuration, such as isa=avx2,threads=1
 *
 * All numbers are of this machine's byte order, words have 32 bits. Standard input:
 *
 *     triangles                       number, then 9 floats each
 *     sets                            number; for each: whether any hit is enough, number of rays, then 7 floats each:
 *                                     origin, direction, tmax
 *     questions, until the end        scene, set, width, coherent, passes: five words
 *
 * Each device has two scenes, without flags (even numbers) and ROBUST (odd), of build quality high. Standard output:
 *
 *     version                         major, minor, patch: three words
 *     scenes                          a float each: seconds to build
 *     answers                         passes > 0: nanoseconds of this thread for all passes, number of hits per pass:
 *                                     64 bits each; passes = 0: for each ray t and triangle, which is -1 without a hit;
 *                                     where any hit is enough, triangle 0 means one
 *
 * It ends with 1 and a word on standard error if anything fails.
 *
 * Embree is loaded as the program runs, without a header: what this program calls is declared here, after the manual of
 * Embree 4. Structures have instPrimID as of 4.3 on; earlier versions do not write as far.
 */
#define _POSIX_C_SOURCE 200809L
#include <dlfcn.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

enum {
    GEOMETRY_TRIANGLE = 0,
    BUFFER_INDEX = 0,
    BUFFER_VERTEX = 1,
    FORMAT_UINT3 = 0x5003,
    FORMAT_FLOAT3 = 0x9003,
    BUILD_HIGH = 2,
    SCENE_ROBUST = 4,
    PROPERTY_VERSION_MAJOR = 1,
    QUERY_COHERENT = 1 << 16
};

#define NONE UINT32_MAX

/* RTCIntersectArguments and RTCOccludedArguments, and room for the field that some builds have behind them. */
struct arguments {
    uint32_t flags, features;
    void *context, *filter, *callback;
    uint64_t more;
};

/* RTCRayN, RTCHitN and RTCRayHitN. */
#define PACKET(N, ALIGN)                                                                                              \
    struct ray##N {                                                                                                   \
        float org[3][N], tnear[N], dir[3][N], time[N], tfar[N];                                                       \
        uint32_t mask[N], id[N], flags[N];                                                                            \
    } __attribute__((aligned(ALIGN)));                                                                                \
    struct hit##N {                                                                                                   \
        float normal[3][N], u[N], v[N];                                                                               \
        uint32_t prim[N], geom[N], inst[N], inst_prim[N];                                                             \
    } __attribute__((aligned(ALIGN)));                                                                                \
    struct ray_hit##N {                                                                                               \
        struct ray##N ray;                                                                                            \
        struct hit##N hit;                                                                                            \
    };                                                                                                                \
    _Static_assert(sizeof(struct ray##N) == 48 * N, "ray");                                                           \
    _Static_assert(offsetof(struct ray_hit##N, hit) == 48 * N, "hit behind ray");                                     \
    _Static_assert(_Alignof(struct ray_hit##N) == ALIGN, "alignment");

PACKET(1, 16)
PACKET(8, 32)
PACKET(16, 64)

static struct {
    void *(*new_device)(const char *);
    int (*device_error)(void *);
    ptrdiff_t (*device_property)(void *, int);
    void *(*new_scene)(void *);
    void (*scene_flags)(void *, int);
    void (*scene_quality)(void *, int);
    void *(*new_geometry)(void *, int);
    void *(*new_buffer)(void *, int, unsigned, int, size_t, size_t);
    void (*geometry_quality)(void *, int);
    void (*commit_geometry)(void *);
    unsigned (*attach)(void *, void *);
    void (*release_geometry)(void *);
    void (*commit_scene)(void *);
    void (*intersect1)(void *, void *, struct arguments *);
    void (*intersect8)(const int *, void *, void *, struct arguments *);
    void (*intersect16)(const int *, void *, void *, struct arguments *);
    void (*occluded1)(void *, void *, struct arguments *);
    void (*occluded8)(const int *, void *, void *, struct arguments *);
    void (*occluded16)(const int *, void *, void *, struct arguments *);
} rtc;

static void fail(const char *what, const char *detail)
{
    fprintf(stderr, "Embree: %s%s%s\n", what, detail ? ": " : "", detail ? detail : "");
    exit(1);
}

static void load(const char *path)
{
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library)
        fail("cannot load", dlerror());
#define LOAD(name, symbol)                                                                                            \
    do {                                                                                                              \
        void *address = dlsym(library, symbol);                                                                       \
        if (!address)                                                                                                 \
            fail("not in the library", symbol);                                                                       \
        memcpy(&rtc.name, &address, sizeof address);                                                                  \
    } while (0)
    LOAD(new_device, "rtcNewDevice");
    LOAD(device_error, "rtcGetDeviceError");
    LOAD(device_property, "rtcGetDeviceProperty");
    LOAD(new_scene, "rtcNewScene");
    LOAD(scene_flags, "rtcSetSceneFlags");
    LOAD(scene_quality, "rtcSetSceneBuildQuality");
    LOAD(new_geometry, "rtcNewGeometry");
    LOAD(new_buffer, "rtcSetNewGeometryBuffer");
    LOAD(geometry_quality, "rtcSetGeometryBuildQuality");
    LOAD(commit_geometry, "rtcCommitGeometry");
    LOAD(attach, "rtcAttachGeometry");
    LOAD(release_geometry, "rtcReleaseGeometry");
    LOAD(commit_scene, "rtcCommitScene");
    LOAD(intersect1, "rtcIntersect1");
    LOAD(intersect8, "rtcIntersect8");
    LOAD(intersect16, "rtcIntersect16");
    LOAD(occluded1, "rtcOccluded1");
    LOAD(occluded8, "rtcOccluded8");
    LOAD(occluded16, "rtcOccluded16");
}

static void *block(size_t bytes)
{
    void *memory = NULL;
    if (posix_memalign(&memory, 64, bytes + 64))
        fail("no memory", NULL);
    memset(memory, 0, bytes + 64);
    return memory;
}

static void get(void *data, size_t bytes)
{
    if (fread(data, 1, bytes, stdin) != bytes)
        fail("standard input ends early", NULL);
}

static void put(const void *data, size_t bytes)
{
    if (fwrite(data, 1, bytes, stdout) != bytes)
        fail("cannot write to standard output", NULL);
}

/* Nanoseconds by a clock. */
static uint64_t now(clockid_t clock)
{
    struct timespec t;
    if (clock_gettime(clock, &t))
        fail("no such clock", NULL);
    return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}

static void check(void *device, const char *what)
{
    int code = rtc.device_error(device);
    if (code == 0)
        return;
    fprintf(stderr, "Embree: error %d: %s\n", code, what);
    exit(1);
}

static void *build(void *device, int flags, uint32_t triangles, const float *corners)
{
    void *scene = rtc.new_scene(device), *mesh = rtc.new_geometry(device, GEOMETRY_TRIANGLE);
    float *p;
    uint32_t *index, i;
    rtc.scene_flags(scene, flags);
    rtc.scene_quality(scene, BUILD_HIGH);
    rtc.geometry_quality(mesh, BUILD_HIGH);
    p = rtc.new_buffer(mesh, BUFFER_VERTEX, 0, FORMAT_FLOAT3, 12, 3 * (size_t)triangles);
    index = rtc.new_buffer(mesh, BUFFER_INDEX, 0, FORMAT_UINT3, 12, triangles);
    check(device, "buffers");
    memcpy(p, corners, 36 * (size_t)triangles);
    for (i = 0; i < 3 * triangles; i++)
        index[i] = i;
    rtc.commit_geometry(mesh);
    rtc.attach(scene, mesh);
    rtc.release_geometry(mesh);
    rtc.commit_scene(scene);
    check(device, "building");
    return scene;
}

/* Rays in the layouts of all widths; the lanes behind the last ray are not valid. */
struct set {
    uint32_t any, rays;
    struct ray1 *rays1;
    struct ray8 *rays8;
    struct ray16 *rays16;
};

/* One ray's answer. */
struct answer {
    float t;
    uint32_t triangle;
};

#define CALL1(what, valid, scene, ray, args) ((void)(valid), rtc.what##1((scene), (ray), (args)))
#define CALL8(what, valid, scene, ray, args) rtc.what##8((valid), (scene), (ray), (args))
#define CALL16(what, valid, scene, ray, args) rtc.what##16((valid), (scene), (ray), (args))

/* Fills a set's rays of one width; traces them, each packet copied to where Embree writes, and returns how many hit. */
#define TRACE(N)                                                                                                      \
    static void fill##N(struct set *set, const float *rays)                                                           \
    {                                                                                                                 \
        size_t i, k;                                                                                                  \
        set->rays##N = block((set->rays + N - 1) / N * sizeof *set->rays##N);                                         \
        for (i = 0; i < set->rays; i++) {                                                                             \
            struct ray##N *packet = &set->rays##N[i / N];                                                             \
            for (k = 0; k < 3; k++) {                                                                                 \
                packet->org[k][i % N] = rays[7 * i + k];                                                              \
                packet->dir[k][i % N] = rays[7 * i + 3 + k];                                                          \
            }                                                                                                         \
            packet->tfar[i % N] = rays[7 * i + 6];                                                                    \
            packet->mask[i % N] = UINT32_MAX;                                                                         \
        }                                                                                                             \
    }                                                                                                                 \
    static uint64_t trace##N(void *scene, const struct set *set, struct arguments *args, struct answer *answers)      \
    {                                                                                                                 \
        int valid[N] __attribute__((aligned(64)));                                                                    \
        uint64_t hits = 0;                                                                                            \
        uint32_t first, i;                                                                                            \
        for (i = 0; i < N; i++)                                                                                       \
            valid[i] = -1;                                                                                            \
        for (first = 0; first < set->rays; first += N) {                                                              \
            uint32_t n = set->rays - first < N ? set->rays - first : N;                                               \
            struct ray_hit##N r;                                                                                      \
            r.ray = set->rays##N[first / N];                                                                          \
            for (i = n; i < N; i++)                                                                                   \
                valid[i] = 0;                                                                                         \
            if (set->any) {                                                                                           \
                CALL##N(occluded, valid, scene, &r.ray, args);                                                        \
                for (i = 0; i < n; i++)                                                                               \
                    hits += r.ray.tfar[i] < 0;                                                                        \
                for (i = 0; answers && i < n; i++)                                                                    \
                    answers[first + i] = (struct answer){0, r.ray.tfar[i] < 0 ? 0 : NONE};                            \
            } else {                                                                                                  \
                for (i = 0; i < N; i++) {                                                                             \
                    r.hit.geom[i] = NONE;                                                                             \
                    r.hit.inst[i] = NONE;                                                                             \
                }                                                                                                     \
                CALL##N(intersect, valid, scene, &r, args);                                                           \
                for (i = 0; i < n; i++)                                                                               \
                    hits += r.hit.geom[i] != NONE;                                                                    \
                for (i = 0; answers && i < n; i++) {                                                                  \
                    uint32_t triangle = r.hit.geom[i] == NONE ? NONE : r.hit.prim[i];                                 \
                    answers[first + i] = (struct answer){r.ray.tfar[i], triangle};                                    \
                }                                                                                                     \
            }                                                                                                         \
        }                                                                                                             \
        return hits;                                                                                                  \
    }

TRACE(1)
TRACE(8)
TRACE(16)

static uint64_t trace(uint32_t width, void *scene, const struct set *set, struct arguments *args,
                      struct answer *answers)
{
    return width == 1 ? trace1(scene, set, args, answers)
         : width == 8 ? trace8(scene, set, args, answers)
                      : trace16(scene, set, args, answers);
}

int main(int count, char **words)
{
    uint32_t triangles, sets, i, question[5];
    int devices = count - 2, d;
    float *corners;
    void **scenes;
    struct set *set;
    if (devices < 1)
        fail("usage", "rays LIBRARY DEVICE...");
    load(words[1]);
#if defined(__SSE2__)
    /* numbers too small to be normal are 0, in operands and results: so the manual recommends */
    _mm_setcsr(_mm_getcsr() | 0x8040);
#endif
    get(&triangles, 4);
    corners = block(36 * (size_t)triangles);
    get(corners, 36 * (size_t)triangles);
    get(&sets, 4);
    set = block(sets * sizeof *set);
    for (i = 0; i < sets; i++) {
        float *rays;
        get(&set[i].any, 4);
        get(&set[i].rays, 4);
        rays = block(28 * (size_t)set[i].rays);
        get(rays, 28 * (size_t)set[i].rays);
        fill1(&set[i], rays);
        fill8(&set[i], rays);
        fill16(&set[i], rays);
        free(rays);
    }
    scenes = block(2 * (size_t)devices * sizeof *scenes);
    for (d = 0; d < devices; d++) {
        void *device = rtc.new_device(words[2 + d]);
        int robust;
        if (!device)
            fail("no device", words[2 + d]);
        for (i = 0; d == 0 && i < 3; i++) {
            uint32_t number = (uint32_t)rtc.device_property(device, PROPERTY_VERSION_MAJOR + (int)i);
            if (i == 0 && number != 4)
                fail("not version 4", words[1]);
            put(&number, 4);
        }
        for (robust = 0; robust < 2; robust++) {
            uint64_t start = now(CLOCK_MONOTONIC);
            float seconds;
            scenes[2 * d + robust] = build(device, robust ? SCENE_ROBUST : 0, triangles, corners);
            seconds = (float)(1e-9 * (double)(now(CLOCK_MONOTONIC) - start));
            put(&seconds, 4);
        }
    }
    fflush(stdout);
    free(corners);
    while (fread(question, sizeof question, 1, stdin) == 1) {
        uint32_t width = question[2], passes = question[4];
        struct arguments args = {question[3] ? QUERY_COHERENT : 0, UINT32_MAX, NULL, NULL, NULL, 0};
        struct set *rays;
        void *scene;
        if (question[0] >= 2 * (uint32_t)devices || question[1] >= sets || (width != 1 && width != 8 && width != 16))
            fail("no such scene, set or width", NULL);
        scene = scenes[question[0]];
        rays = &set[question[1]];
        if (passes == 0) {
            struct answer *answers = block(rays->rays * sizeof *answers);
            trace(width, scene, rays, &args, answers);
            put(answers, rays->rays * sizeof *answers);
            free(answers);
        } else {
            uint64_t start = now(CLOCK_THREAD_CPUTIME_ID), answer[2] = {0, 0};
            for (i = 0; i < passes; i++)
                answer[1] = trace(width, scene, rays, &args, NULL);
            answer[0] = now(CLOCK_THREAD_CPUTIME_ID) - start;
            put(answer, sizeof answer);
        }
        fflush(stdout);
    }
    return 0;
}
