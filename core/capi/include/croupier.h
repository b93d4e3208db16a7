/*
 * Croupier: a path tracer to embed, C interface. The manual is docs/C.md.
 *
 * All memory is the caller's. No call allocates, starts threads, reads a clock or files, or has hidden state. Functions that
 * return a status write the reason of a failure into *message, which may be null. Structs with a member struct_size: set it
 * to sizeof, and the rest to 0, before every use.
 *
 * Handles are checked as far as that is possible: null, misaligned, destroyed, suspended, moved and foreign objects, and calls
 * that exclude each other at the same time, are answered with a status. Memory that was freed, or that the program writes to
 * while an object is in it, is not.
 */

#ifndef CROUPIER_H
#define CROUPIER_H

/* Made by cbindgen of core/capi: change the sources, not this file. */

#include <stddef.h>
#include <stdint.h>

// Version of this interface: it grows when functions, members of structs or numbers are added, and a program for a
// smaller one works on. What does not work on is another soname.
#define CROUPIER_ABI_VERSION 1

// "No such index".
#define CROUPIER_NONE UINT32_MAX

// Alignment of every block of memory that becomes an object, bytes.
#define CROUPIER_ALIGN 64

// Bytes that croupier_scene_init needs besides the blob.
#define CROUPIER_SCENE_BYTES 2048

// First number of surfaces that are not triangles of the scene.
#define CROUPIER_OWN_SURFACE 2147483648

// What became of a call. Functions that return a status have done nothing unless it is CROUPIER_OK, or their
// documentation says otherwise. Later versions may return numbers that are not listed here.
enum croupier_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Done.
  CROUPIER_OK = 0,
  // A pointer is null that must not be.
  CROUPIER_NULL = 1,
  // A pointer is not a multiple of what its type or documentation asks for.
  CROUPIER_MISALIGNED = 2,
  // A block of memory or a buffer is too small, or an array has another length than it must have.
  CROUPIER_SIZE = 3,
  // The member struct_size is not that of any version of the struct.
  CROUPIER_STRUCT_SIZE = 4,
  // A pointer does not point to an object of its type: never initialised, overwritten, or moved.
  CROUPIER_NO_OBJECT = 5,
  // The object was destroyed or suspended.
  CROUPIER_DESTROYED = 6,
  // The object is in use by a call that excludes this one: on another thread, or one whose callback makes this call.
  CROUPIER_BUSY = 7,
  // Blocks of memory overlap that must not.
  CROUPIER_OVERLAP = 8,
  // The processor lacks instructions that the library uses.
  CROUPIER_INSTRUCTIONS = 9,
  // An index, a name or a number that names nothing, or is out of its range.
  CROUPIER_RANGE = 10,
  // A text is not UTF-8, or longer than 4096 bytes.
  CROUPIER_TEXT = 11,
  // The bytes are no valid scene.
  CROUPIER_SCENE = 12,
  // The settings, alone or together, cannot be used.
  CROUPIER_SETTINGS = 13,
  // An edit of the scene that breaks a rule of scenes.
  CROUPIER_EDIT = 14,
  // An edit of the scene that only baking it anew can make.
  CROUPIER_EDIT_FIXED = 15,
  // The scene is not in the state that the session was started or changed for: croupier_session_change_scene.
  CROUPIER_SCENE_CHANGED = 16,
  // Scene or settings need a part that the library does not have, such as a scattering model of the host's own.
  CROUPIER_EFFECTS = 17,
  // Session and shard, or session and saved bytes, are of different plans.
  CROUPIER_PLAN = 18,
  // No iteration has begun, or one is under way that must not be.
  CROUPIER_ITERATION = 19,
  // A shard has not finished the iteration.
  CROUPIER_UNFINISHED = 20,
  // Not all shards of the plan in order.
  CROUPIER_SHARDS = 21,
  // The block does not hold a suspended session or shard of this plan.
  CROUPIER_NOT_SUSPENDED = 22,
  // The settings did not ask for it, or it is not there before the end of the first iteration.
  CROUPIER_ABSENT = 23,
  // Saved bytes that are damaged, or of another version, scene or setting.
  CROUPIER_SAVED = 24,
  // Arrays that make no scene.
  CROUPIER_COMPOSE = 25,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum croupier_status croupier_status;
#else
typedef int32_t croupier_status;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Auxiliary values of pixels. Where nothing else is said, planes hold means over the camera samples, those that missed
// everything counted as 0: divide by CROUPIER_AOV_ALPHA for means over the samples that hit.
enum croupier_aov
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Albedo of the first hit: red, green, blue.
  CROUPIER_AOV_ALBEDO = 0,
  // Shading normal of the first hit, world space: x, y, z.
  CROUPIER_AOV_NORMAL = 1,
  // Distance to the first hit, world units.
  CROUPIER_AOV_DEPTH = 2,
  // Share of the camera samples that hit, 0 to 1.
  CROUPIER_AOV_ALPHA = 3,
  // Sums of the factors of roulette at vertices of depth 1, 2, 3 and above, and numbers of these vertices: eight
  // planes.
  CROUPIER_AOV_FACTORS = 4,
  // Number of paths: the camera sample and what splitting added.
  CROUPIER_AOV_PATHS = 5,
  // Number of rays; has no plane, see croupier_pixel.
  CROUPIER_AOV_COST = 6,
  // Radiance of what is seen directly: red, green, blue.
  CROUPIER_AOV_EMISSION = 7,
  // Radiance of light that scattered once.
  CROUPIER_AOV_DIRECT = 8,
  // Radiance of light that scattered more often.
  CROUPIER_AOV_INDIRECT = 9,
  // Index of the material of the first sample's first hit, -1 without one.
  CROUPIER_AOV_MATERIAL = 10,
  // Index of its object, -1 without one: croupier_scene_object_name.
  CROUPIER_AOV_OBJECT = 11,
  // The two materials that cover most of the pixel: index, share, index, share.
  CROUPIER_AOV_MATERIAL_COVERAGE = 12,
  // The two objects that cover most of the pixel, likewise.
  CROUPIER_AOV_OBJECT_COVERAGE = 13,
  // Motion of the first hit across the picture while the shutter is open, pixels: x, y.
  CROUPIER_AOV_MOTION = 14,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum croupier_aov croupier_aov;
#else
typedef uint32_t croupier_aov;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Projections of a camera.
enum croupier_camera_kind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Pinhole or thin lens.
  CROUPIER_PERSPECTIVE = 0,
  // Parallel rays.
  CROUPIER_ORTHOGRAPHIC = 1,
  // Every direction, latitude by longitude.
  CROUPIER_PANORAMIC = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum croupier_camera_kind croupier_camera_kind;
#else
typedef uint32_t croupier_camera_kind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Kinds of lights.
enum croupier_light_kind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Emitting triangle (its front side).
  CROUPIER_LIGHT_AREA = 0,
  // Environment, map or constant.
  CROUPIER_LIGHT_ENVIRONMENT = 1,
  // Isotropic point.
  CROUPIER_LIGHT_POINT = 2,
  // Parallel light.
  CROUPIER_LIGHT_DIRECTIONAL = 3,
  // Point that shines into a cone.
  CROUPIER_LIGHT_SPOT = 4,
  // Parallel light with the spread of a distant disk.
  CROUPIER_LIGHT_SUN = 5,
  // Sphere that emits to its outside.
  CROUPIER_LIGHT_SPHERE = 6,
  // Rectangle that emits from its front.
  CROUPIER_LIGHT_RECTANGLE = 7,
  // Disk that emits from its front.
  CROUPIER_LIGHT_DISK = 8,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum croupier_light_kind croupier_light_kind;
#else
typedef uint32_t croupier_light_kind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Kinds of materials.
enum croupier_material_kind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Lambertian reflection.
  CROUPIER_DIFFUSE = 0,
  // Perfect mirror without Fresnel.
  CROUPIER_MIRROR = 1,
  // Smooth conductor.
  CROUPIER_CONDUCTOR = 2,
  // GGX conductor.
  CROUPIER_ROUGH_CONDUCTOR = 3,
  // Smooth dielectric interface.
  CROUPIER_DIELECTRIC = 4,
  // GGX dielectric interface.
  CROUPIER_ROUGH_DIELECTRIC = 5,
  // Thin dielectric sheet.
  CROUPIER_THIN_DIELECTRIC = 6,
  // Smooth coat over a diffuse base.
  CROUPIER_PLASTIC = 7,
  // GGX coat over a diffuse base.
  CROUPIER_ROUGH_PLASTIC = 8,
  // Index-matched boundary.
  CROUPIER_NULL_BOUNDARY = 9,
  // Layers of sheen, coat, metal, dielectric, transmission and a diffuse base: croupier_principled.
  CROUPIER_PRINCIPLED = 10,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum croupier_material_kind croupier_material_kind;
#else
typedef uint32_t croupier_material_kind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Environments of composed scenes.
enum croupier_surround
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // None.
  CROUPIER_SURROUND_NONE = 0,
  // The same radiance from all directions.
  CROUPIER_SURROUND_CONSTANT = 1,
  // A map by latitude and longitude.
  CROUPIER_SURROUND_MAP = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum croupier_surround croupier_surround;
#else
typedef uint32_t croupier_surround;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What ends a render; the amount is a parameter of croupier_session_next_samples.
enum croupier_target
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Samples per pixel. The picture does not depend on the machine.
  CROUPIER_TARGET_SAMPLES = 0,
  // Seconds by the program's clock. No iteration begins that would pass them at the speed so far; one that has begun
  // is meant to be finished, and the first one, a sample per pixel, is rendered in any case.
  CROUPIER_TARGET_SECONDS = 1,
  // Rays of all kinds: no iteration begins that would pass them at the cost so far.
  CROUPIER_TARGET_RAYS = 2,
  // Estimated relMSE of the picture, from 4 samples per pixel on.
  CROUPIER_TARGET_ERROR = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum croupier_target croupier_target;
#else
typedef uint32_t croupier_target;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// A scene: a baked blob in the program's memory. Calls that read it may run on several threads at a time, steps of
// shards included; an edit needs it for itself.
typedef struct croupier_scene croupier_scene;

// A session: the picture so far and what was learned, in the program's memory. Calls that take a const pointer to it
// may run on several threads at a time; the others need it for themselves, or answer CROUPIER_BUSY.
typedef struct croupier_session croupier_session;

// A shard: one unit of parallel work, in the program's memory. One call at a time uses it.
typedef struct croupier_shard croupier_shard;

// Text about a failure, for people: what was wrong with which object, with numbers.
typedef struct croupier_message {
  // UTF-8, ended by a zero byte, cut off between two characters where it is too long. Empty after a call that succeeded.
  char text[256];
} croupier_message;

// What a scene has.
typedef struct croupier_scene_facts {
  // sizeof(croupier_scene_facts), set by the program.
  uint32_t struct_size;
  // Default columns of pictures.
  uint32_t width;
  // Default rows.
  uint32_t height;
  // Default number of path segments.
  uint32_t max_depth;
  // Triangles.
  uint32_t triangles;
  // Materials.
  uint32_t materials;
  // Lights.
  uint32_t lights;
  // Media.
  uint32_t media;
  // Objects; 0 in a scene without instances, else the world and what instances place.
  uint32_t objects;
  // Instances.
  uint32_t instances;
  // Smallest coordinates, world space.
  float bounds_min[3];
  // Largest coordinates.
  float bounds_max[3];
  // Identity of the scene as it is: changes with every edit, and comes back when an edit is taken back.
  uint64_t identity;
} croupier_scene_facts;

// The camera of a scene. A pixel sample is a point (x, y) in [0, width) x [0, height), y down; with X = 2 x / width -
// 1 and Y = 2 y / height - 1 the ray of a perspective camera looks along forward + right X + down Y, from origin or a
// point of the lens; that of an orthographic one begins at origin + right X + down Y and runs along forward; a
// panoramic one looks from origin to longitude pi X (0 is forward, positive towards right) and latitude pi/2 Y
// (positive towards down). Pictures of another shape than width x height keep the height of the view.
typedef struct croupier_camera {
  // sizeof(croupier_camera), set by the program.
  uint32_t struct_size;
  // croupier_camera_kind.
  uint32_t kind;
  // World position.
  float origin[3];
  // Unit viewing axis.
  float forward[3];
  // From the middle of the picture to its right edge: perspective at distance 1, orthographic in world units;
  // panoramic a unit vector.
  float right[3];
  // From the middle of the picture to its lower edge, likewise.
  float down[3];
  // Radius of the lens, world units; 0 is a pinhole, and 0 for other projections than perspective.
  float lens_radius;
  // Distance of the plane in focus along the axis, world units.
  float focus_distance;
  // Default columns of pictures; sessions keep those of their settings.
  uint32_t width;
  // Default rows.
  uint32_t height;
} croupier_camera;

// A light of a scene. Colours are linear Rec. 709.
typedef struct croupier_light {
  // croupier_light_kind; cannot change.
  uint32_t kind;
  // Area: index of the triangle; cannot change. Sphere, rectangle, disk: 1 if it emits to both sides, plus 2 if
  // camera rays do not see it.
  uint32_t triangle;
  // Area: area of the triangle, world units squared; cannot change.
  float area;
  // Area: 1 + index of the world's instance that the triangle is in, or 0; cannot change.
  uint32_t instance;
  // Point, spot: position. Sphere, rectangle, disk: middle. Directional, sun: unit direction towards the light.
  float vector[3];
  // Area, sphere, rectangle, disk: radiance. Point: intensity. Spot: intensity on the axis. Directional, sun:
  // irradiance on a facing surface. Up to 1e18.
  float emission[3];
  // Spot: unit axis, 1 - cos of the outer and of the inner half angle, 0. Sun: 1 - cos of its angular radius, then
  // 0. Sphere: radius, then 0. Rectangle: two halves of edges. Disk: unit normal, radius, 0, 0. Others: 0.
  float params[6];
} croupier_light;

// A material of a scene. Members that its kind does not use are 0, indices CROUPIER_NONE.
typedef struct croupier_material {
  // croupier_material_kind.
  uint32_t kind;
  // 1 if both sides behave like the front, plus 2 if the texture's alpha is the share of light that meets the
  // surface, plus 4 if rough models give back what single scattering between microfacets loses.
  uint32_t flags;
  // Index of the texture that replaces reflectance, or CROUPIER_NONE.
  uint32_t texture;
  // First entry of its tables. The library's: ignored when a material is set.
  uint32_t table;
  // Diffuse albedo, or scale of the specular reflection, 0 to 1; base colour of a principled material. Linear Rec.
  // 709.
  float reflectance[3];
  // GGX width, 1e-4 to 1.
  float alpha;
  // Conductors: real refractive index by channel. Dielectrics and plastics: the first is the index behind the front
  // side over that before it.
  float eta[3];
  // Plastics: reflectance of the interface from inside for diffuse light, which baking derives.
  float fdr;
  // Conductors: extinction by channel.
  float k[3];
  // Index of the medium behind the front side, or CROUPIER_NONE.
  uint32_t medium;
} croupier_material;

// A texture with an affine map of its coordinates.
typedef struct croupier_texture_use {
  // Index of the texture, or CROUPIER_NONE.
  uint32_t texture;
  // Rows of the matrix that maps (u, v, 1) of the surface to coordinates of the texture.
  float transform[2][3];
} croupier_texture_use;

// Albedo of a layer of one roughness.
typedef struct croupier_layer {
  // By the square roots of cosines, equally spaced from 0 to 1.
  float albedo[32];
  // At the nodes of a quadrature over cosines.
  float nodes[4];
} croupier_layer;

// What a principled material has besides croupier_material. Numbers without a range are from 0 to 1. The last four
// members are derived by baking from the roughnesses, the coat and the sheen: keep them with those.
typedef struct croupier_principled {
  // sizeof(croupier_principled), set by the program.
  uint32_t struct_size;
  // Share of metal.
  float metalness;
  // Square root of the GGX width.
  float roughness;
  // Share of what enters the dielectric that is transmitted.
  float transmission;
  // Strength of the coat.
  float coat;
  // Share of light that meets the surface, if the material has the flag 2.
  float opacity;
  // Reflectance of the dielectric at grazing angles.
  float f90;
  // Reflectance of the dielectric at normal incidence.
  float f0[3];
  // Colour of the sheen.
  float sheen_color[3];
  // GGX width of the coat, 1e-4 to 1.
  float coat_alpha;
  // Width of the distribution of the sheen's fibres, 0.01 to 1.
  float sheen_alpha;
  // Refractive index of solid transmission, 0.1 to 10 and at least 0.01 away from 1.
  float eta;
  // Factor on the tangential part of mapped normals, up to 1000.
  float normal_scale;
  // 1 if what light passes is a sheet and not a solid, plus 2 if the alpha of the base texture multiplies the
  // opacity.
  uint32_t flags;
  // First entry of the rows of reflection among the scene's tables.
  uint32_t reflection;
  // First entry of the rows of energy among the scene's tables, or CROUPIER_NONE.
  uint32_t energy;
  // Textures: base colour and opacity; metal (blue) and roughness (green); transmission (red); coat (red); normal;
  // emission.
  struct croupier_texture_use textures[6];
  // Albedo of the coat at full strength.
  struct croupier_layer coat_layer;
  // Albedo of a white sheen.
  struct croupier_layer sheen_layer;
} croupier_principled;

// The environment of a scene.
typedef struct croupier_environment {
  // sizeof(croupier_environment), set by the program.
  uint32_t struct_size;
  // 0 for constant radiance, 1 for a map by latitude and longitude; cannot change.
  uint32_t kind;
  // Index of its light; cannot change.
  uint32_t light;
  // Columns of the map; cannot change.
  uint32_t width;
  // Rows of the map; cannot change.
  uint32_t height;
  // Rows of the rotation from the world to the map.
  float to_local[3][3];
  // Constant: radiance. Map: scale by channel.
  float radiance[3];
} croupier_environment;

// An instance of an object.
typedef struct croupier_instance {
  // sizeof(croupier_instance), set by the program.
  uint32_t struct_size;
  // Index of the object that it places.
  uint32_t object;
  // 0 if it is hidden.
  uint32_t visible;
  // Index of its first light among the world's.
  uint32_t first_light;
  // Rows of the affine maps to the space around it, when the shutter opens and when it closes.
  float to_world[2][3][4];
} croupier_instance;

// Rows of the affine maps of an instance to the space around it, when the shutter opens and when it closes: the same
// twice if it stands still.
typedef struct croupier_transform {
  // The two maps.
  float to_world[2][3][4];
} croupier_transform;

// A texture of a scene.
typedef struct croupier_texture {
  // First texel among those of all textures.
  uint32_t first;
  // Columns, at least 1.
  uint32_t width;
  // Rows, at least 1.
  uint32_t height;
  // Of textures of principled materials: 1 if red, green and blue are numbers and not sRGB, plus 2 (clamped) or 4
  // (mirrored) along u, plus 8 or 16 along v. Others have 0.
  uint32_t flags;
} croupier_texture;

// A medium, which fills the inside of the surfaces whose material refers to it. Coefficients are per unit length.
typedef struct croupier_medium {
  // 0: homogeneous. 1, a density grid, is baked only.
  uint32_t kind;
  // Absorption coefficient.
  float sigma_a[3];
  // Scattering coefficient.
  float sigma_s[3];
  // Emitted radiance: the source per unit length is sigma_a * emission.
  float emission[3];
  // Mean cosine of the phase function, -0.99 to 0.99, positive forwards.
  float g;
  // Grids: smallest corner; else 0.
  float bounds_min[3];
  // Grids: largest corner; else 0.
  float bounds_max[3];
  // Grids: cells along x, y, z; else 0.
  uint32_t cells[3];
  // Grids: first density; else 0.
  uint32_t first_density;
  // Grids: first majorant; else 0.
  uint32_t first_majorant;
  // 0.
  uint32_t reserved[2];
} croupier_medium;

// Arrays that make up a scene. Those that are not needed are null, with a count of 0. Lengths are in the scene's unit,
// emission is linear Rec. 709. The arrays are read while a call that takes this struct runs, and not afterwards.
typedef struct croupier_arrays {
  // sizeof(croupier_arrays), set by the program.
  uint32_t struct_size;
  // Path segments from the camera, a default for the settings; 0 stands for 40.
  uint32_t max_depth;
  // Camera, see croupier_camera_from_view.
  const struct croupier_camera *camera;
  // Positions of vertices, world space, each coordinate up to 1e9 as a magnitude.
  const float (*positions)[3];
  // Normals of vertices, of any length, or null: all triangles are flat. Triangles with a vertex whose normal is 0
  // are flat.
  const float (*normals)[3];
  // Texture coordinates of vertices, v upwards, or null.
  const float (*uvs)[2];
  // Number of vertices.
  size_t vertices;
  // Vertices of triangles, counter-clockwise seen from the front. Those without an area are left out of the
  // scene, and those behind them count on without a gap: triangle_count less the triangles of croupier_scene_facts
  // are missing, and croupier_scene_triangles gives what the numbers of hits mean.
  const uint32_t (*triangles)[3];
  // Materials of triangles, or null: all have material 0.
  const uint32_t *triangle_materials;
  // Number of triangles.
  size_t triangle_count;
  // Materials, see croupier_material_init. fdr of plastics may be 0, and the table of rough ones CROUPIER_NONE:
  // they are computed then.
  const struct croupier_material *materials;
  // Radiance that the triangles of each material emit from their front, or null: none emit.
  const float (*emission)[3];
  // Number of materials.
  size_t material_count;
  // Tables that materials refer to.
  const float *tables;
  // Number of their entries.
  size_t table_count;
  // Names of materials, UTF-8, each ended by a newline.
  const uint8_t *names;
  // Bytes of names.
  size_t names_size;
  // Textures.
  const struct croupier_texture *textures;
  // Number of textures.
  size_t texture_count;
  // Texels of textures: bytes red, green, blue, alpha from the lowest on; row 0 is the top.
  const uint32_t *texels;
  // Number of texels.
  size_t texel_count;
  // Homogeneous media, those of higher priority first.
  const struct croupier_medium *media;
  // Number of media.
  size_t medium_count;
  // Lights that are no triangles, see croupier_light_from_source. In the scene they follow those of the triangles:
  // first those without a shape, then the environment, then those with one.
  const struct croupier_light *lights;
  // Number of these lights.
  size_t light_count;
  // croupier_surround.
  uint32_t surround;
  // Map: columns, 1 to 65536.
  uint32_t map_width;
  // Map: rows, 2 to 65536.
  uint32_t map_height;
  // Constant: radiance. Map: factor on all texels.
  float radiance[3];
  // Map: rows of the rotation from the map to the world.
  float map_to_world[3][3];
  // 0.
  uint32_t reserved;
  // Map: radiance of its texels, the row towards +Y of the map first.
  const float (*map)[3];
} croupier_arrays;

// A camera by where it is and what it looks at, world space.
typedef struct croupier_view {
  // sizeof(croupier_view), set by the program.
  uint32_t struct_size;
  // croupier_camera_kind.
  uint32_t kind;
  // Position.
  double origin[3];
  // A point on the viewing axis.
  double target[3];
  // Upwards, not parallel to the axis.
  double up[3];
  // Perspective: full vertical field of view, degrees, above 0.001 and below 179.9. Orthographic: height of the
  // picture, world units. Panoramic: not read.
  double extent;
  // Columns, 1 to 65536.
  uint32_t width;
  // Rows, 1 to 65536.
  uint32_t height;
  // Radius of the lens, 0 for a pinhole.
  float lens_radius;
  // Distance of the plane in focus along the axis; not read without a lens.
  float focus_distance;
} croupier_view;

// A light that is no triangle, in the units that people use. Members that its kind does not have are not read.
typedef struct croupier_light_source {
  // sizeof(croupier_light_source), set by the program.
  uint32_t struct_size;
  // croupier_light_kind, from CROUPIER_LIGHT_POINT on.
  uint32_t kind;
  // Point, spot: position. Sphere, rectangle, disk: middle.
  float position[3];
  // Directional, sun, spot: direction in which the light travels. Disk: normal of its front. Of any length but 0.
  float direction[3];
  // Point, spot: intensity. Directional, sun: irradiance of a facing surface. Sphere, rectangle, disk: radiance.
  float emission[3];
  // Rectangle: edges, at right angles; the front is where their cross product points.
  float edges[2][3];
  // Sphere, disk: radius.
  float radius;
  // Spot: half angle within which the intensity is full, degrees.
  float inner_deg;
  // Spot: half angle at which the intensity reaches 0, degrees.
  float outer_deg;
  // Sun: angular diameter, degrees.
  float angle_deg;
  // Sphere, rectangle, disk: not 0 if it emits from its back as well.
  uint32_t two_sided;
  // Sphere, rectangle, disk: not 0 if camera rays do not see it.
  uint32_t hidden;
} croupier_light_source;

// Settings of a render. Its members are the library's; the struct may be copied. Threads may read it at the same time.
typedef struct croupier_settings {
  // Not for programs.
  uint64_t opaque[64];
} croupier_settings;

// What a render needs: settings that were checked, and sizes. Its members are the library's; the struct may be copied.
// Threads may read it at the same time. Sessions and shards have what they need of it and do not refer to it.
typedef struct croupier_plan {
  // Not for programs.
  uint64_t opaque[128];
} croupier_plan;

// Sizes of a plan's blocks of memory. Each block starts at a multiple of CROUPIER_ALIGN bytes and may hold anything
// before.
typedef struct croupier_sizes {
  // sizeof(croupier_sizes), set by the program.
  uint32_t struct_size;
  // Columns of the picture.
  uint32_t width;
  // Rows of the picture.
  uint32_t height;
  // Number of shards.
  uint32_t shards;
  // Bytes of a session's block.
  uint64_t session;
  // Bytes of a block that any shard fits into; croupier_plan_shard_size is exact.
  uint64_t shard;
  // Bytes of stack that a call needs at most, without what callbacks need.
  uint64_t stack;
} croupier_sizes;

// Eight rays: points origin + t direction with tmin < t < tmax. The first index is the axis (x, y, z), the second the
// lane. Directions need not be unit vectors. Rays that the library hands over start at a multiple of 32 bytes.
typedef struct croupier_rays8 {
  // Origins, world space.
  float origin[3][8];
  // Directions.
  float direction[3][8];
  // Smallest parameters, exclusive.
  float tmin[8];
  // Largest parameters, exclusive; may be infinite.
  float tmax[8];
  // Times, from 0 where the shutter opens to 1 where it closes.
  float time[8];
} croupier_rays8;

// What eight rays hit. Lanes without a hit hold tmax, CROUPIER_NONE and 0.
typedef struct croupier_hits8 {
  // Ray parameters.
  float t[8];
  // Indices of the scene's triangles; from CROUPIER_OWN_SURFACE on numbers of the host's own surfaces.
  uint32_t triangle[8];
  // Barycentric weights of the triangles' second vertices. Of own surfaces u, v and instance are the host's to use.
  float u[8];
  // Barycentric weights of the third vertices; the first ones have 1 - u - v.
  float v[8];
  // Instances around the triangles: the world's, and the one within it; CROUPIER_NONE where there is none.
  uint32_t instance[2][8];
} croupier_hits8;

// Closest hits of the lanes in active (bit i is lane i). hits holds no hits when it is called; returns the lanes that
// hit. Lanes with numbers that cannot be (t outside the ray, no such triangle) count as no hit. May be called on
// several threads at a time, with the same user.
typedef uint32_t (*croupier_closest)(void *user,
                                     const struct croupier_rays8 *rays,
                                     uint32_t active,
                                     struct croupier_hits8 *hits);

// Lanes of active that hit anything. Threads as of croupier_closest.
typedef uint32_t (*croupier_occluded)(void *user, const struct croupier_rays8 *rays, uint32_t active);

// Eight points on the host's own surfaces. The first index is the axis, the second the lane.
typedef struct croupier_surfaces8 {
  // Points, world space.
  float point[3][8];
  // Geometric unit normals, on the side that is the front.
  float normal[3][8];
  // How far points may be from their surfaces, world units: rays that leave begin that far away.
  float error[8];
  // Shading normals; 0 where normal serves.
  float shading_normal[3][8];
  // Texture coordinates, v upwards.
  float uv[2][8];
  // Directions in which the first texture coordinate grows, for normal maps; 0: any.
  float tangent[3][8];
  // Materials of the scene; what does not exist is black.
  uint32_t material[8];
  // Objects for CROUPIER_AOV_OBJECT, or CROUPIER_NONE.
  uint32_t object[8];
} croupier_surfaces8;

// What is where the hits of the lanes in own are, each of one of the host's own surfaces. Threads as of
// croupier_closest.
typedef void (*croupier_surface)(void *user,
                                 const struct croupier_rays8 *rays,
                                 const struct croupier_hits8 *hits,
                                 uint32_t own,
                                 struct croupier_surfaces8 *surfaces);

// Eight camera samples of a picture.
typedef struct croupier_samples8 {
  // Columns of the picture.
  uint32_t width;
  // Rows of the picture.
  uint32_t height;
  // Columns of the pixels.
  uint32_t column[8];
  // Rows of the pixels.
  uint32_t row[8];
  // Points of the picture in pixels, x to the right and y down, uniform in each pixel's square.
  float position[2][8];
  // Two further independent numbers in [0, 1).
  float u[2][8];
} croupier_samples8;

// Rays of eight camera samples.
typedef struct croupier_source_rays8 {
  // Origins, world space.
  float origin[3][8];
  // Unit directions.
  float direction[3][8];
  // What the radiance along the ray counts in the pixel, by channel: 1 for radiance.
  float weight[3][8];
} croupier_source_rays8;

// Rays of camera samples, in place of the camera's; returns the lanes of active that have one, the others are black.
// A function of the samples alone, or the picture depends on threads. Threads as of croupier_closest.
typedef uint32_t (*croupier_rays)(void *user,
                                  const struct croupier_samples8 *samples,
                                  uint32_t active,
                                  struct croupier_source_rays8 *rays);

// Points of surfaces at which eight camera samples begin.
typedef struct croupier_source_points8 {
  // Indices of triangles.
  uint32_t triangle[8];
  // Instances around them, as of croupier_hits8.
  uint32_t instance[2][8];
  // Barycentric weights of the second vertices.
  float u[8];
  // Barycentric weights of the third vertices.
  float v[8];
  // What the radiance counts in the pixel, by channel: 1 for irradiance over pi, pi for irradiance.
  float scale[3][8];
} croupier_source_points8;

// Points of surfaces at which camera samples begin, in place of the camera's rays: each brings what a white diffuse
// surface would reflect there. Otherwise as croupier_rays.
typedef uint32_t (*croupier_points)(void *user,
                                    const struct croupier_samples8 *samples,
                                    uint32_t active,
                                    struct croupier_source_points8 *points);

// What a host computes in place of the library. Members that are null are the library's own part. Callbacks must
// return: no longjmp and no C++ exception may leave them. They may read the scene (croupier_scene_closest); calls
// that change an object that is in use answer CROUPIER_BUSY.
typedef struct croupier_parts {
  // sizeof(croupier_parts), set by the program.
  uint32_t struct_size;
  // 0.
  uint32_t reserved;
  // Handed to every callback.
  void *user;
  // Closest hits; together with occluded, or neither.
  croupier_closest closest;
  // Any hits.
  croupier_occluded occluded;
  // Own surfaces; needs closest.
  croupier_surface surface;
  // Camera rays; not together with points.
  croupier_rays rays;
  // Points at which camera samples begin.
  croupier_points points;
} croupier_parts;

// Work of a render, which croupier_session_next_samples remembers here between its calls. It begins anew with a picture.
typedef struct croupier_work {
  // sizeof(croupier_work), set by the program.
  uint32_t struct_size;
  // Camera samples per pixel.
  uint32_t samples;
  // Rays of all kinds.
  uint64_t rays;
  // Seconds by the program's clock.
  double seconds;
  // Camera samples per pixel of the last iteration.
  uint32_t last_samples;
  // 0.
  uint32_t reserved;
  // Rays of all kinds of the last iteration.
  uint64_t last_rays;
  // Seconds of the last iteration.
  double last_seconds;
} croupier_work;

// Lanes used of lanes offered: eight per packet.
typedef struct croupier_utilisation {
  // Packets run.
  uint64_t packets;
  // Active lanes in them.
  uint64_t lanes;
} croupier_utilisation;

// Counts of work, and of every event in which a bound was reached.
typedef struct croupier_counters {
  // sizeof(croupier_counters), set by the program.
  uint32_t struct_size;
  // 0.
  uint32_t reserved;
  // Closest-hit rays from the camera.
  uint64_t camera_rays;
  // Closest-hit rays from scattering.
  uint64_t scatter_rays;
  // Closest-hit rays that went on straight.
  uint64_t straight_rays;
  // Steps through media.
  uint64_t medium_steps;
  // Shadow rays, counted again behind every surface that they passed.
  uint64_t shadow_rays;
  // Camera samples finished.
  uint64_t camera_samples;
  // Samples of vertices.
  uint64_t vertex_samples;
  // Vertices at which roulette ended the path.
  uint64_t paths_terminated;
  // Samples that splitting added.
  uint64_t splits;
  // Splits that a nearly full ring limited.
  uint64_t splits_limited_by_ring;
  // Splits that the budget of their camera sample limited.
  uint64_t splits_limited_by_budget;
  // Shadow rays terminated by roulette.
  uint64_t shadow_rays_terminated;
  // Light samples left out by roulette.
  uint64_t light_samples_skipped;
  // Sum of the segments of all paths.
  uint64_t path_segments;
  // Samples offered to the statistics.
  uint64_t samples_logged;
  // Samples that were not learned from because their bin had enough.
  uint64_t samples_refused;
  // Shadow rays that were not learned from because their bin had enough.
  uint64_t shadows_refused;
  // Samples without a record because the ledger was full.
  uint64_t ledger_full;
  // Factors that were not finite and became 1.
  uint64_t factors_not_finite;
  // Paths that ended because of the longest length, before max-depth.
  uint64_t max_length_reached;
  // Light samples whose distance was clamped.
  uint64_t distances_clamped;
  // Rays with so many steps through a medium that roulette decided.
  uint64_t media_roulettes;
  // Shadow rays taken for blocked behind too many surfaces: light that is lost.
  uint64_t passages_cut;
  // Contributions that were not finite and were not added.
  uint64_t non_finite;
  // Index of the pixel of the first of them, plus 1; 0 without one.
  uint64_t first_non_finite;
  // Lanes of the scatter stage.
  struct croupier_utilisation scatter;
  // Lanes of the closest-hit stage.
  struct croupier_utilisation trace;
  // Lanes of the shadow-ray stage.
  struct croupier_utilisation occlude;
  // Lanes of the shading stage.
  struct croupier_utilisation surface;
  // Lanes of look-ups in statistics.
  struct croupier_utilisation look_ups;
  // Lanes of rays that passed surfaces.
  struct croupier_utilisation passed;
  // Largest number of vertices that waited at once.
  uint64_t ring_peak;
  // Closest-hit rays of light paths, which path guiding learns from at first, and as many steps through media as cost
  // the same.
  uint64_t light_path_rays;
} croupier_counters;

// A pixel of the picture so far. Linear Rec. 709.
typedef struct croupier_pixel {
  // Mean radiance.
  float mean[3];
  // Standard error of the mean, right on average over the picture from two samples on.
  float standard_error[3];
  // Camera samples; 0 before the end of the first iteration.
  uint32_t samples;
  // Rays of all kinds, at most 2^32 - 1; 0 unless the settings ask for the AOV cost or are adaptive.
  uint32_t rays;
} croupier_pixel;

// Estimated error of the picture against its own expectation.
typedef struct croupier_error_estimate {
  // sizeof(croupier_error_estimate), set by the program.
  uint32_t struct_size;
  // 1 if the samples tell the error. 0 if few pixels cause most of it: more of their kind are probably not found yet,
  // or one that is found counts for too much; or if, in a picture of less than 40,000 pixels, one sample that shows the
  // brightest light in a mirror, glass or another narrow lobe would make rel_mse more than a tenth larger. There is no
  // interval then: the error is low at least.
  uint32_t resolved;
  // Mean over pixels and channels of variance / (expectation^2 + 0.01), without the worst 0.01 % of the pixels, times
  // independence. The expectation is estimated from the pixel and those around it.
  double rel_mse;
  // Lower end of its 95 % confidence interval.
  double low;
  // Upper end; infinite if the error is not resolved.
  double high;
  // The same mean over all pixels.
  double rel_mse_all;
  // Variance of the pixels over that of independent samples; 1 while it is not known.
  double independence;
} croupier_error_estimate;

// One round of camera samples.
typedef struct croupier_iteration {
  // sizeof(croupier_iteration), set by the program.
  uint32_t struct_size;
  // Camera samples per pixel in it.
  uint32_t samples;
  // 1 for the first; 0 before it.
  uint64_t number;
  // Camera samples per pixel before it.
  uint32_t first_sample;
  // 0.
  uint32_t reserved;
  // Number of times that the picture began again.
  uint64_t restarts;
} croupier_iteration;

// Every status.
#define croupier_status_ALL { CROUPIER_OK, CROUPIER_NULL, CROUPIER_MISALIGNED, CROUPIER_SIZE, CROUPIER_STRUCT_SIZE, CROUPIER_NO_OBJECT, CROUPIER_DESTROYED, CROUPIER_BUSY, CROUPIER_OVERLAP, CROUPIER_INSTRUCTIONS, CROUPIER_RANGE, CROUPIER_TEXT, CROUPIER_SCENE, CROUPIER_SETTINGS, CROUPIER_EDIT, CROUPIER_EDIT_FIXED, CROUPIER_SCENE_CHANGED, CROUPIER_EFFECTS, CROUPIER_PLAN, CROUPIER_ITERATION, CROUPIER_UNFINISHED, CROUPIER_SHARDS, CROUPIER_NOT_SUSPENDED, CROUPIER_ABSENT, CROUPIER_SAVED, CROUPIER_COMPOSE, }

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// CROUPIER_ABI_VERSION of the library that is loaded: the program needs at least the one that it was compiled with.
uint32_t croupier_abi_version(void);

// Version of the library, such as 0.1.0. The text is the library's and stays.
const char *croupier_version(void);

// Instruction set that the library was compiled for: x86-64, x86-64-v3, aarch64 and the like. The text is the
// library's and stays.
const char *croupier_instruction_set(void);

// CROUPIER_OK if the processor, and the operating system, have all instructions that the library was compiled for;
// CROUPIER_INSTRUCTIONS, with the first that is missing in the message, if not: no other function is to be called
// then. On other processors than x86-64 nothing is known, and the answer is CROUPIER_OK.
croupier_status croupier_check_processor(struct croupier_message *message);

// The best instruction set that processor and operating system offer, of those that there are builds for: x86-64,
// x86-64-v3 or x86-64-v4; elsewhere that of the library. Writes at most size bytes, the last one 0; length, which may
// be null, becomes the length of the whole text without it.
croupier_status croupier_processor_instruction_set(char *text,
                                                   size_t size,
                                                   size_t *length,
                                                   struct croupier_message *message);

// What a status means, in a few English words that end with a zero byte. Never null, whatever the number. The text is
// the library's and stays.
const char *croupier_status_text(int32_t status);

// Makes a scene object in memory (CROUPIER_SCENE_BYTES bytes at a multiple of CROUPIER_ALIGN) for a baked blob, which
// is checked in one pass and then read in place. The blob starts at a multiple of 4, of 64 for full speed; it is the
// scene's until croupier_scene_destroy, and edits change it. *scene becomes the handle, which is the address of the
// memory; null after a failure. CROUPIER_SCENE, with the object and the number that are wrong in the message, if the
// blob is none.
croupier_status croupier_scene_init(void *memory,
                                    size_t memory_size,
                                    void *blob,
                                    size_t blob_size,
                                    struct croupier_scene **scene,
                                    struct croupier_message *message);

// Ends a scene: its memory and its blob are the program's again. Sessions of it can still be read, not stepped.
// CROUPIER_BUSY, and the scene goes on, while another call uses it.
croupier_status croupier_scene_destroy(struct croupier_scene *scene,
                                       struct croupier_message *message);

// What the scene has, and its identity.
croupier_status croupier_scene_info(const struct croupier_scene *scene,
                                    struct croupier_scene_facts *facts,
                                    struct croupier_message *message);

// The camera as it is.
croupier_status croupier_scene_camera(const struct croupier_scene *scene,
                                      struct croupier_camera *camera,
                                      struct croupier_message *message);

// Light index as it is. CROUPIER_RANGE if there is none.
croupier_status croupier_scene_light(const struct croupier_scene *scene,
                                     uint32_t index,
                                     struct croupier_light *light,
                                     struct croupier_message *message);

// Material index as it is. CROUPIER_RANGE if there is none.
croupier_status croupier_scene_material(const struct croupier_scene *scene,
                                        uint32_t index,
                                        struct croupier_material *material,
                                        struct croupier_message *message);

// Tables of material index as croupier_scene_set_material takes them, so that a material with tables can get another
// colour. *needed, which may be null, becomes their number, 0 for most kinds; tables, which may be null, gets them.
// CROUPIER_RANGE if there is no such material, CROUPIER_SIZE if count is less than needed.
croupier_status croupier_scene_material_tables(const struct croupier_scene *scene,
                                               uint32_t index,
                                               float *tables,
                                               size_t count,
                                               size_t *needed,
                                               struct croupier_message *message);

// Triangles first to first + count - 1 as hits number them (croupier_hits8): corners gets the positions of the three
// vertices of each, materials the material of each; both may be null. An intersector of the program's own is built of
// these, since composing leaves out triangles without an area and baking may order them anew. Triangles within
// instances have the space of their object. CROUPIER_RANGE if there are not so many.
croupier_status croupier_scene_triangles(const struct croupier_scene *scene,
                                         size_t first,
                                         size_t count,
                                         float (*corners)[3][3],
                                         uint32_t *materials,
                                         struct croupier_message *message);

// What principled material index has besides croupier_scene_material. CROUPIER_RANGE if there is none, or it is of
// another kind.
croupier_status croupier_scene_principled(const struct croupier_scene *scene,
                                          uint32_t index,
                                          struct croupier_principled *principled,
                                          struct croupier_message *message);

// The environment as it is. CROUPIER_RANGE if there is none.
croupier_status croupier_scene_environment(const struct croupier_scene *scene,
                                           struct croupier_environment *environment,
                                           struct croupier_message *message);

// Instance index as it is. CROUPIER_RANGE if there is none.
croupier_status croupier_scene_instance(const struct croupier_scene *scene,
                                        uint32_t index,
                                        struct croupier_instance *instance,
                                        struct croupier_message *message);

// Name of material index, empty if it has none. Writes at most size bytes, the last one 0; length, which may be null,
// becomes the length of the whole name without it.
croupier_status croupier_scene_material_name(const struct croupier_scene *scene,
                                             uint32_t index,
                                             char *name,
                                             size_t size,
                                             size_t *length,
                                             struct croupier_message *message);

// Name of object index as CROUPIER_AOV_OBJECT shows it, empty if it has none. Texts as of
// croupier_scene_material_name.
croupier_status croupier_scene_object_name(const struct croupier_scene *scene,
                                           uint32_t index,
                                           char *name,
                                           size_t size,
                                           size_t *length,
                                           struct croupier_message *message);

// Replaces the camera. CROUPIER_EDIT, with the number that is wrong in the message, if it breaks a rule of scenes;
// the scene is as before then. As after every edit, sessions of the scene need croupier_session_change_scene before
// they step again.
croupier_status croupier_scene_set_camera(struct croupier_scene *scene,
                                          const struct croupier_camera *camera,
                                          struct croupier_message *message);

// Replaces light index: emission, and what else its kind lets change (croupier_light). CROUPIER_EDIT_FIXED if another
// member differs from croupier_scene_light. Takes a pass over the lights.
croupier_status croupier_scene_set_light(struct croupier_scene *scene,
                                         uint32_t index,
                                         const struct croupier_light *light,
                                         struct croupier_message *message);

// Gives all emitting triangles of a material this radiance, linear Rec. 709; *changed, which may be null, becomes
// their number. Takes a pass over the lights.
croupier_status croupier_scene_set_emission(struct croupier_scene *scene,
                                            uint32_t material,
                                            const float (*radiance)[3],
                                            uint32_t *changed,
                                            struct croupier_message *message);

// Replaces the environment's rotation and radiance or scale. CROUPIER_RANGE if there is none, CROUPIER_EDIT_FIXED if
// another member differs.
croupier_status croupier_scene_set_environment(struct croupier_scene *scene,
                                               const struct croupier_environment *environment,
                                               struct croupier_message *message);

// Replaces material index and its tables: count numbers, as many as its kind has (none for most kinds: null and 0).
// Those of croupier_scene_material_tables serve as long as kind, roughness, index of refraction and compensation stay.
// CROUPIER_EDIT_FIXED if the tables have another length than there is room for, or another material reads them too.
croupier_status croupier_scene_set_material(struct croupier_scene *scene,
                                            uint32_t index,
                                            const struct croupier_material *material,
                                            const float *tables,
                                            size_t count,
                                            struct croupier_message *message);

// Replaces principled material index as a whole. CROUPIER_EDIT_FIXED if the old or the new one is of another kind.
croupier_status croupier_scene_set_principled(struct croupier_scene *scene,
                                              uint32_t index,
                                              const struct croupier_material *material,
                                              const struct croupier_principled *principled,
                                              struct croupier_message *message);

// Moves count instances in one round, whose boxes and lights are brought up to date once. *done, which may be null,
// becomes the number of those that were moved: all of them, or those before the one that is refused (CROUPIER_EDIT;
// the message has its index).
croupier_status croupier_scene_set_transforms(struct croupier_scene *scene,
                                              const uint32_t *indices,
                                              const struct croupier_transform *transforms,
                                              size_t count,
                                              size_t *done,
                                              struct croupier_message *message);

// Shows (visible is not 0) or hides an instance with its lights.
croupier_status croupier_scene_set_visible(struct croupier_scene *scene,
                                           uint32_t index,
                                           uint32_t visible,
                                           struct croupier_message *message);

// Bytes of scratch memory that croupier_scene_rebuild needs.
croupier_status croupier_scene_rebuild_size(struct croupier_scene *scene,
                                            size_t *bytes,
                                            struct croupier_message *message);

// Builds the world's tree anew over its instances as they are, which makes rays faster after far moves. scratch
// starts at a multiple of 4 and is the program's again when the call returns. CROUPIER_SIZE if it is too small,
// CROUPIER_RANGE in a scene without instances, CROUPIER_EDIT_FIXED if the blob has too little room; the tree is as it
// was then.
croupier_status croupier_scene_rebuild(struct croupier_scene *scene,
                                       void *scratch,
                                       size_t scratch_size,
                                       struct croupier_message *message);

// Makes the bytes of an edited scene a blob again, to be stored: until then their hash is that of the bytes before.
// Takes a pass over all bytes. The identity of the scene changes.
croupier_status croupier_scene_seal(struct croupier_scene *scene,
                                    struct croupier_message *message);

// Bytes that croupier_scene_compose needs: of the blob (what always suffices; most take a third of it), and of
// intermediate results. CROUPIER_COMPOSE, with the record and the number that are wrong in the message, if the arrays
// make no scene.
croupier_status croupier_scene_compose_size(const struct croupier_arrays *arrays,
                                            size_t *blob_size,
                                            size_t *scratch_size,
                                            struct croupier_message *message);

// Builds a scene of arrays: its tree of triangles, its tables, everything that baking does. blob and scratch start at
// multiples of CROUPIER_ALIGN and overlap neither each other nor an array. *length becomes the blob's own length:
// blob and length are what croupier_scene_init takes. scratch is the program's again. Takes a time that grows with
// the triangles times their logarithm. CROUPIER_COMPOSE as of croupier_scene_compose_size.
croupier_status croupier_scene_compose(const struct croupier_arrays *arrays,
                                       void *blob,
                                       size_t blob_size,
                                       void *scratch,
                                       size_t scratch_size,
                                       size_t *length,
                                       struct croupier_message *message);

// Fills in a material: its kind (croupier_material_kind), and what no material of the kind has. CROUPIER_RANGE if
// there is no such kind.
croupier_status croupier_material_init(struct croupier_material *material,
                                       uint32_t kind,
                                       struct croupier_message *message);

// The camera of a view, for croupier_arrays and croupier_scene_set_camera. CROUPIER_RANGE, with the number in the
// message, if there is none.
croupier_status croupier_camera_from_view(const struct croupier_view *view,
                                          struct croupier_camera *camera,
                                          struct croupier_message *message);

// The record of a light, for croupier_arrays and croupier_scene_set_light. A black one is kept: it may light up later.
// CROUPIER_RANGE, with the number in the message, if there is none.
croupier_status croupier_light_from_source(const struct croupier_light_source *source,
                                           struct croupier_light *light,
                                           struct croupier_message *message);

// Makes settings of memory that may hold anything: the default ones, with size and depth of the scene. scene may be
// null; then croupier_settings_set_size and croupier_settings_set of "max-depth" have to follow.
croupier_status croupier_settings_init(struct croupier_settings *settings,
                                       const struct croupier_scene *scene,
                                       struct croupier_message *message);

// Sets one setting from a text: names, values and their meaning are the options of the program croupier, such as
// ("rrs", "ears"), ("aovs", "albedo,normal"), ("cache-bytes", "24MiB"). CROUPIER_RANGE if no setting has the name,
// CROUPIER_SETTINGS if the text is no value in its range; nothing has changed then.
croupier_status croupier_settings_set(struct croupier_settings *settings,
                                      const char *name,
                                      const char *value,
                                      struct croupier_message *message);

// Text of a setting, which croupier_settings_set reads back. Writes at most size bytes, the last one 0; length, which
// may be null, becomes the length of the whole text without it. CROUPIER_RANGE if no setting has the name.
croupier_status croupier_settings_get(const struct croupier_settings *settings,
                                      const char *name,
                                      char *value,
                                      size_t size,
                                      size_t *length,
                                      struct croupier_message *message);

// Number of settings.
size_t croupier_settings_count(void);

// Name of setting index, below croupier_settings_count(). Texts as of croupier_settings_get.
croupier_status croupier_settings_name(size_t index,
                                       char *name,
                                       size_t size,
                                       size_t *length,
                                       struct croupier_message *message);

// Meaning and range of setting index, a line. Texts as of croupier_settings_get.
croupier_status croupier_settings_help(size_t index,
                                       char *help,
                                       size_t size,
                                       size_t *length,
                                       struct croupier_message *message);

// Sets columns and rows of the picture, pixels; at least 1 x 1 and at most 2^31 pixels, which croupier_plan_init
// checks.
croupier_status croupier_settings_set_size(struct croupier_settings *settings,
                                           uint32_t width,
                                           uint32_t height,
                                           struct croupier_message *message);

// Sets the number of shards, units of parallel work, 1 to 65536. The picture depends on it.
croupier_status croupier_settings_set_shards(struct croupier_settings *settings,
                                             uint32_t shards,
                                             struct croupier_message *message);

// Sets the seed of all random numbers: another one gives another, independent picture.
croupier_status croupier_settings_set_seed(struct croupier_settings *settings,
                                           uint64_t seed,
                                           struct croupier_message *message);

// Columns and rows of the picture, pixels; 0 x 0 while they are open.
croupier_status croupier_settings_size(const struct croupier_settings *settings,
                                       uint32_t *width,
                                       uint32_t *height,
                                       struct croupier_message *message);

// Makes a plan of memory that may hold anything: checks the settings and measures the blocks. CROUPIER_SETTINGS if
// they cannot be used, with the reason in the message.
croupier_status croupier_plan_init(struct croupier_plan *plan,
                                   const struct croupier_settings *settings,
                                   struct croupier_message *message);

// Sizes of the blocks.
croupier_status croupier_plan_sizes(const struct croupier_plan *plan,
                                    struct croupier_sizes *sizes,
                                    struct croupier_message *message);

// Bytes of the block of shard index, which depend on its pixels. CROUPIER_RANGE if the plan has fewer shards.
croupier_status croupier_plan_shard_size(const struct croupier_plan *plan,
                                         uint32_t index,
                                         size_t *bytes,
                                         struct croupier_message *message);

// Makes a session of a scene in memory: as many bytes as croupier_plan_sizes says, at a multiple of CROUPIER_ALIGN.
// The scene stays where it is, and exists, as long as the session is used; the plan may go. *session becomes the
// handle, which is the address of the memory; null after a failure.
croupier_status croupier_session_init(void *memory,
                                      size_t memory_size,
                                      const struct croupier_plan *plan,
                                      const struct croupier_scene *scene,
                                      struct croupier_session **session,
                                      struct croupier_message *message);

// croupier_session_init with parts of the host's own, which are copied. CROUPIER_RANGE if parts are there that do not
// go together.
croupier_status croupier_session_init_with(void *memory,
                                           size_t memory_size,
                                           const struct croupier_plan *plan,
                                           const struct croupier_scene *scene,
                                           const struct croupier_parts *parts,
                                           struct croupier_session **session,
                                           struct croupier_message *message);

// Goes on with the session that croupier_session_suspend has left in memory, which may have been copied elsewhere or
// stored since, with the bits that it would have had without the break. The plan must be equal; with another scene
// the picture begins anew, with what was learned. CROUPIER_NOT_SUSPENDED if the memory holds no such session.
croupier_status croupier_session_resume(void *memory,
                                        size_t memory_size,
                                        const struct croupier_plan *plan,
                                        const struct croupier_scene *scene,
                                        struct croupier_session **session,
                                        struct croupier_message *message);

// croupier_session_resume with parts of the host's own.
croupier_status croupier_session_resume_with(void *memory,
                                             size_t memory_size,
                                             const struct croupier_plan *plan,
                                             const struct croupier_scene *scene,
                                             const struct croupier_parts *parts,
                                             struct croupier_session **session,
                                             struct croupier_message *message);

// Leaves the session in its memory, to be resumed later, in another place, or by another process of the same kind. The
// handle is dead. Shards are suspended each for itself.
croupier_status croupier_session_suspend(struct croupier_session *session,
                                         struct croupier_message *message);

// Ends a session: its memory is the program's again. CROUPIER_BUSY, and the session goes on, while another call uses
// it.
croupier_status croupier_session_destroy(struct croupier_session *session,
                                         struct croupier_message *message);

// Begins a round of samples camera samples per pixel. One that is under way is abandoned. Shards notice at their next
// step.
croupier_status croupier_session_begin_iteration(struct croupier_session *session,
                                                 uint32_t samples,
                                                 struct croupier_message *message);

// Goes on with the end of the iteration: merges what the shards gathered, estimates the error, learns. All shards of
// the plan in order, each finished; the same ones until *more is 0, when the next iteration can begin. units is a
// budget: work in the time of a ray, some 300 instructions each. With the same bits whatever the budgets.
// CROUPIER_SHARDS, CROUPIER_UNFINISHED, CROUPIER_PLAN, CROUPIER_ITERATION: the picture is as before then.
croupier_status croupier_session_finish_iteration(struct croupier_session *session,
                                                  struct croupier_shard *const *shards,
                                                  size_t count,
                                                  uint64_t units,
                                                  uint32_t *more,
                                                  struct croupier_message *message);

// Forgets the picture and begins again with iteration 1; an iteration that is under way is abandoned. If keep is 0,
// what was learned is forgotten too, and the pictures that follow are those of a new session to the bit.
croupier_status croupier_session_restart(struct croupier_session *session,
                                         uint32_t keep,
                                         struct croupier_message *message);

// Goes over to a scene that was edited, or to another one, and begins a new picture of it as croupier_session_restart
// does. Sizes and path length stay those of the plan. CROUPIER_EFFECTS if the library lacks what the scene needs; the
// session is as before then.
croupier_status croupier_session_change_scene(struct croupier_session *session,
                                              const struct croupier_scene *scene,
                                              uint32_t keep,
                                              struct croupier_message *message);

// Camera samples per pixel of the next iteration, for croupier_session_begin_iteration; 0 when the target is reached.
// Iterations are short at first, so that a picture is soon there and statistics are renewed often, and longer later.
// target is a croupier_target, amount how much of it. seconds is the time that the iterations of this picture have taken by
// the program's clock, without pauses; not read unless the target is in seconds. work is what the call before has left
// there. To be called between iterations. CROUPIER_RANGE for an amount that is not above 0 or not finite, seconds that are
// below 0 or not finite, or another target.
croupier_status croupier_session_next_samples(const struct croupier_session *session,
                                              uint32_t target,
                                              double amount,
                                              double seconds,
                                              struct croupier_work *work,
                                              uint32_t *samples,
                                              struct croupier_message *message);

// Makes shard index of a plan in memory: as many bytes as croupier_plan_shard_size says, at a multiple of
// CROUPIER_ALIGN. It serves one session; make it anew for another one. *shard becomes the handle, which is the
// address of the memory; null after a failure. CROUPIER_RANGE if the plan has fewer shards.
croupier_status croupier_shard_init(void *memory,
                                    size_t memory_size,
                                    const struct croupier_plan *plan,
                                    uint32_t index,
                                    struct croupier_shard **shard,
                                    struct croupier_message *message);

// Takes up the shard that croupier_shard_suspend has left in memory, which may have been copied elsewhere or stored
// since. CROUPIER_NOT_SUSPENDED if the memory holds no shard of an equal plan with this index, suspended.
croupier_status croupier_shard_resume(void *memory,
                                      size_t memory_size,
                                      const struct croupier_plan *plan,
                                      uint32_t index,
                                      struct croupier_shard **shard,
                                      struct croupier_message *message);

// Leaves the shard in its memory, an iteration that is under way included, to be resumed. The handle is dead.
croupier_status croupier_shard_suspend(struct croupier_shard *shard,
                                       struct croupier_message *message);

// Ends a shard: its memory is the program's again. CROUPIER_BUSY, and the shard goes on, while another call uses it.
croupier_status croupier_shard_destroy(struct croupier_shard *shard,
                                       struct croupier_message *message);

// Works until about rays rays are traced (exceeded by less than one packet of 16, but for rays that pass surfaces or
// media) or the shard has finished the iteration; *more becomes 1 or 0. Many small steps and one big step give the
// same bits. Different shards may step on different threads at a time, with the same session; a program cancels by
// not calling again. CROUPIER_PLAN if session and shard are of different plans, CROUPIER_SCENE_CHANGED if the scene was
// edited since the session was told, CROUPIER_ITERATION if none has begun; *more is 0 then.
croupier_status croupier_shard_step(struct croupier_shard *shard,
                                    const struct croupier_session *session,
                                    uint64_t rays,
                                    uint32_t *more,
                                    struct croupier_message *message);

// Starts no further camera samples in the iteration of the shard's last step: stepping on finishes those in flight,
// so that the iteration can end early and the picture stays unbiased.
croupier_status croupier_shard_stop(struct croupier_shard *shard,
                                    struct croupier_message *message);

// Counts of the current iteration.
croupier_status croupier_shard_counters(const struct croupier_shard *shard,
                                        struct croupier_counters *counters,
                                        struct croupier_message *message);

// Pixels first to first + count - 1, row by row from the top left. CROUPIER_RANGE if there are not so many. While an
// iteration is being finished, some pixels have it and others do not.
croupier_status croupier_session_pixels(const struct croupier_session *session,
                                        size_t first,
                                        size_t count,
                                        struct croupier_pixel *pixels,
                                        struct croupier_message *message);

// Mean radiance of all pixels: red, green and blue of each, row by row from the top left. count is the number of
// floats, three times the number of pixels, or the answer is CROUPIER_SIZE.
croupier_status croupier_session_rgb(const struct croupier_session *session,
                                     float *rgb,
                                     size_t count,
                                     struct croupier_message *message);

// Number of planes of an auxiliary value (croupier_aov); 0 if there is no such value.
uint32_t croupier_aov_channels(uint32_t aov);

// Plane channel of an auxiliary value (croupier_aov), a float per pixel, row by row from the top left. count is the
// number of pixels, or the answer is CROUPIER_SIZE. CROUPIER_ABSENT if the settings do not ask for it, and before the
// end of the first iteration; CROUPIER_RANGE if it has no such channel.
croupier_status croupier_session_plane(const struct croupier_session *session,
                                       uint32_t aov,
                                       uint32_t channel,
                                       float *values,
                                       size_t count,
                                       struct croupier_message *message);

// Estimated error of the picture, as of the end of the last iteration.
croupier_status croupier_session_error_estimate(const struct croupier_session *session,
                                                struct croupier_error_estimate *estimate,
                                                struct croupier_message *message);

// The current iteration.
croupier_status croupier_session_iteration(const struct croupier_session *session,
                                           struct croupier_iteration *iteration,
                                           struct croupier_message *message);

// Counts of all finished iterations.
croupier_status croupier_session_counters(const struct croupier_session *session,
                                          struct croupier_counters *counters,
                                          struct croupier_message *message);

// Pixels of a shard in the iteration under way, for previews: writes red, green and blue of the mean of each pixel
// that has finished camera samples where croupier_session_rgb has them, and leaves the others as they are. count is
// three times the number of pixels of the picture, or the answer is CROUPIER_SIZE. Means are biased while samples of
// a pixel are in flight.
// *written, which may be null, becomes the number of pixels; 0 if the shard has not stepped in this iteration.
croupier_status croupier_shard_unfinished(const struct croupier_shard *shard,
                                          const struct croupier_session *session,
                                          float *rgb,
                                          size_t count,
                                          size_t *written,
                                          struct croupier_message *message);

// Closest hits of eight rays with the scene's triangles: picking, visibility, and the built-in part of an intersector
// of the host's own. Lanes of active count (bit i is lane i); *hit becomes the lanes that hit.
croupier_status croupier_scene_closest(const struct croupier_scene *scene,
                                       const struct croupier_rays8 *rays,
                                       uint32_t active,
                                       struct croupier_hits8 *hits,
                                       uint32_t *hit,
                                       struct croupier_message *message);

// Lanes of active whose rays hit any of the scene's triangles.
croupier_status croupier_scene_occluded(const struct croupier_scene *scene,
                                        const struct croupier_rays8 *rays,
                                        uint32_t active,
                                        uint32_t *occluded,
                                        struct croupier_message *message);

// Bytes that croupier_session_save_statistics writes. CROUPIER_ABSENT if neither the strategy nor path
// guiding learns anything of the scene.
croupier_status croupier_session_statistics_size(const struct croupier_session *session,
                                                 size_t *bytes,
                                                 struct croupier_message *message);

// Writes what was learned of the scene, for another run, another machine, another scene of the same bounds. The bytes
// are the same on every machine. CROUPIER_SIZE if there is too little room, CROUPIER_ABSENT if neither the strategy
// nor path guiding learns anything of the scene.
croupier_status croupier_session_save_statistics(const struct croupier_session *session,
                                                 void *bytes,
                                                 size_t size,
                                                 struct croupier_message *message);

// Replaces (merge is 0) what was learned of the scene by saved bytes, or adds them. Whatever is loaded changes
// efficiency only. The bytes are checked first; CROUPIER_SAVED, with the reason in the message, if they are damaged
// or of another scene or objective, CROUPIER_ABSENT while an iteration runs or if they hold nothing that the session
// learns.
croupier_status croupier_session_load_statistics(struct croupier_session *session,
                                                 const void *bytes,
                                                 size_t size,
                                                 uint32_t merge,
                                                 struct croupier_message *message);

// The estimate of the pixels that the strategy works with (denoised, or means of blocks): red, green and blue of
// each, row by row. count is three times the number of pixels, or the answer is CROUPIER_SIZE. CROUPIER_ABSENT if the
// settings need none, and before the end of the first iteration.
croupier_status croupier_session_estimate(const struct croupier_session *session,
                                          float *rgb,
                                          size_t count,
                                          struct croupier_message *message);

// Replaces the built-in estimate of the pixels by the host's (such as that of another denoiser), for good: red, green
// and blue of each pixel, row by row. It changes efficiency only. CROUPIER_SIZE if count is not three times the
// number of pixels, the settings have no estimate per pixel, or an iteration runs.
croupier_status croupier_session_give_estimate(struct croupier_session *session,
                                               const float *rgb,
                                               size_t count,
                                               struct croupier_message *message);

// Most bytes that croupier_shard_save writes of shard index, in any iteration. CROUPIER_RANGE if the plan has fewer
// shards.
croupier_status croupier_plan_saved_shard_size(const struct croupier_plan *plan,
                                               uint32_t index,
                                               size_t *bytes,
                                               struct croupier_message *message);

// Writes what the end of an iteration reads of a finished shard, for croupier_shard_load of another process; *written
// becomes the number of bytes. Equal sums give equal bytes. CROUPIER_UNFINISHED if the shard has not finished an
// iteration, CROUPIER_SIZE if there is too little room; nothing is written then.
croupier_status croupier_shard_save(const struct croupier_shard *shard,
                                    void *bytes,
                                    size_t size,
                                    size_t *written,
                                    struct croupier_message *message);

// Takes the place of the shard that croupier_shard_save has written: joins the iteration of the session with its
// sums, finished. Sessions of several processes that begin the same iterations and end each with all shards have the
// same picture and the same statistics to the bit. CROUPIER_PLAN or CROUPIER_SAVED, with the reason in the message,
// if the bytes are of another scene, plan, shard, iteration or version, or damaged; the shard is as before then.
croupier_status croupier_shard_load(struct croupier_shard *shard,
                                    const struct croupier_session *session,
                                    const void *bytes,
                                    size_t size,
                                    struct croupier_message *message);

// Goes on as if so many iterations, of so many camera samples per pixel in all, had been before: for one picture in
// parts that are rendered apart and added afterwards. Parts with other numbers of iterations and disjoint ranges of
// samples take other random numbers. CROUPIER_ITERATION if one has begun since the picture did.
croupier_status croupier_session_skip(struct croupier_session *session,
                                      uint64_t iterations,
                                      uint32_t samples,
                                      struct croupier_message *message);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* CROUPIER_H */
