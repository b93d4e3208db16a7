/*
 * The declarations of Embree 4 that docs/FROM_EMBREE.md uses, so that its example can be compiled without Embree. Layouts are
 * left to Embree; names and types are its own.
 */
#include <stddef.h>

#define RTC_ALIGN(...) __attribute__((aligned(__VA_ARGS__)))
#define RTC_INVALID_GEOMETRY_ID ((unsigned int)-1)

typedef struct RTCDeviceTy *RTCDevice;
typedef struct RTCSceneTy *RTCScene;
typedef struct RTCGeometryTy *RTCGeometry;

enum RTCGeometryType { RTC_GEOMETRY_TYPE_TRIANGLE = 0 };
enum RTCBufferType { RTC_BUFFER_TYPE_INDEX = 0, RTC_BUFFER_TYPE_VERTEX = 1 };
enum RTCFormat { RTC_FORMAT_UINT3 = 0x5003, RTC_FORMAT_FLOAT3 = 0x9003 };
enum RTCSceneFlags { RTC_SCENE_FLAG_ROBUST = 4 };

struct RTC_ALIGN(32) RTCRay8 {
    float org_x[8], org_y[8], org_z[8], tnear[8], dir_x[8], dir_y[8], dir_z[8], time[8], tfar[8];
    unsigned int mask[8], id[8], flags[8];
};

struct RTC_ALIGN(32) RTCHit8 {
    float Ng_x[8], Ng_y[8], Ng_z[8], u[8], v[8];
    unsigned int primID[8], geomID[8], instID[1][8];
};

struct RTCRayHit8 {
    struct RTCRay8 ray;
    struct RTCHit8 hit;
};

struct RTCIntersectArguments;
struct RTCOccludedArguments;

RTCGeometry rtcNewGeometry(RTCDevice device, enum RTCGeometryType type);
void *rtcSetNewGeometryBuffer(RTCGeometry geometry, enum RTCBufferType type, unsigned int slot, enum RTCFormat format,
                              size_t byteStride, size_t itemCount);
void rtcCommitGeometry(RTCGeometry geometry);
void rtcReleaseGeometry(RTCGeometry geometry);
RTCScene rtcNewScene(RTCDevice device);
void rtcSetSceneFlags(RTCScene scene, enum RTCSceneFlags flags);
unsigned int rtcAttachGeometry(RTCScene scene, RTCGeometry geometry);
void rtcCommitScene(RTCScene scene);
void rtcIntersect8(const int *valid, RTCScene scene, struct RTCRayHit8 *rayhit, struct RTCIntersectArguments *args);
void rtcOccluded8(const int *valid, RTCScene scene, struct RTCRay8 *ray, struct RTCOccludedArguments *args);
