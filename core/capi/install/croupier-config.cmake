# find_package(croupier) and target_link_libraries(program croupier::croupier), or croupier::static.
get_filename_component(_croupier_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)

if(NOT TARGET croupier::croupier)
  add_library(croupier::croupier SHARED IMPORTED)
  set_target_properties(croupier::croupier PROPERTIES
    IMPORTED_LOCATION "${_croupier_prefix}/lib/libcroupier.so.0"
    IMPORTED_SONAME "libcroupier.so.0"
    INTERFACE_INCLUDE_DIRECTORIES "${_croupier_prefix}/include")
endif()

if(NOT TARGET croupier::static)
  add_library(croupier::static STATIC IMPORTED)
  set_target_properties(croupier::static PROPERTIES
    IMPORTED_LOCATION "${_croupier_prefix}/lib/libcroupier.a"
    INTERFACE_INCLUDE_DIRECTORIES "${_croupier_prefix}/include")
endif()

unset(_croupier_prefix)
