/*
 * The header compiles as C99 and as C++17 without a warning, and its structs have the sizes that programs were compiled with:
 * one that changes breaks programs without a word. New members go to the end of structs with a struct_size.
 */
#include <croupier.h>

#define SIZE(type, bytes) typedef char type##_has_another_size[sizeof(type) == (bytes) ? 1 : -1]
#define SIZE64(type, bytes) typedef char type##_has_another_size[sizeof(void *) != 8 || sizeof(type) == (bytes) ? 1 : -1]

SIZE(croupier_status, 4);
SIZE(croupier_message, 256);
SIZE(croupier_settings, 512);
SIZE(croupier_plan, 1024);
SIZE(croupier_sizes, 40);
SIZE(croupier_scene_facts, 72);
SIZE(croupier_camera, 72);
SIZE(croupier_view, 104);
SIZE(croupier_light, 64);
SIZE(croupier_light_source, 92);
SIZE(croupier_material, 64);
SIZE(croupier_texture, 16);
SIZE(croupier_medium, 96);
SIZE(croupier_texture_use, 28);
SIZE(croupier_layer, 144);
SIZE(croupier_principled, 536);
SIZE(croupier_environment, 68);
SIZE(croupier_instance, 112);
SIZE(croupier_transform, 96);
SIZE(croupier_pixel, 32);
SIZE(croupier_error_estimate, 48);
SIZE(croupier_iteration, 32);
SIZE(croupier_work, 48);
SIZE(croupier_counters, 320);
SIZE(croupier_rays8, 288);
SIZE(croupier_hits8, 192);
SIZE(croupier_surfaces8, 544);
SIZE(croupier_samples8, 200);
SIZE(croupier_source_rays8, 288);
SIZE(croupier_source_points8, 256);
SIZE64(croupier_parts, 56);
SIZE64(croupier_arrays, 264);

int main(void)
{
    return croupier_abi_version() >= CROUPIER_ABI_VERSION ? CROUPIER_OK : 1;
}
