# clearance_install_library(part SOURCES ... HEADERS ... DEFINITIONS ... LIBS ...): the shared library Clearance::part
# for other projects, component part_library. It exports only what its headers mark as CLEARANCE_API; its dependencies stay
# inside, so that a process may contain other builds of the same libraries.
include(CMakePackageConfigHelpers)

# Headers that are installed with each library.
set(clearance_shared_headers wire/types.h wire/mesh_as.h wire/query_options.h wire/api/query.h wire/api/errors.h wire/api/result.h
  wire/api/check.h wire/api/scene_info.h wire/api/new_body.h wire/api/prepared.h wire/api/prepared_path.h wire/api/curve_limits.h wire/api/device_query.h wire/protocol.h wire/payloads.h client/eigen.h
  planner/edge_prover.h planner/rrt_connect.h planner/planner.h planner/path_report.h planner/path_states.h
  planner/stop_check.h)
list(TRANSFORM clearance_shared_headers PREPEND ${PROJECT_SOURCE_DIR}/)

function(clearance_install_library part)
  cmake_parse_arguments(ARG "" "" "SOURCES;HEADERS;DEFINITIONS;LIBS" ${ARGN})
  set(_target clearance_${part}_shared)
  set(_component ${part}_library)
  set(_package ${CMAKE_INSTALL_LIBDIR}/cmake/Clearance)
  add_library(${_target} SHARED ${ARG_SOURCES})
  set_target_properties(${_target} PROPERTIES
    OUTPUT_NAME clearance_${part} EXPORT_NAME ${part} VERSION ${PROJECT_VERSION} SOVERSION ${CLEARANCE_SOVERSION}
    LINK_DEPENDS ${PROJECT_SOURCE_DIR}/cmake/library.map)
  target_compile_definitions(${_target} PRIVATE ${ARG_DEFINITIONS})
  target_compile_features(${_target} PUBLIC cxx_std_20)
  target_link_libraries(${_target} PRIVATE clearance_protocol clearance_options ${ARG_LIBS})
  target_link_options(${_target} PRIVATE LINKER:--exclude-libs,ALL
    LINKER:--version-script,${PROJECT_SOURCE_DIR}/cmake/library.map)
  target_include_directories(${_target} INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)

  install(TARGETS ${_target} EXPORT Clearance-${part}
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT ${_component} NAMELINK_COMPONENT ${_component})
  install(EXPORT Clearance-${part} NAMESPACE Clearance:: DESTINATION ${_package} COMPONENT ${_component})
  list(TRANSFORM ARG_HEADERS PREPEND ${PROJECT_SOURCE_DIR}/)
  install(FILES ${clearance_shared_headers} ${ARG_HEADERS} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/clearance
    COMPONENT ${_component})
  write_basic_package_version_file(${PROJECT_BINARY_DIR}/cmake/ClearanceConfigVersion.cmake COMPATIBILITY SameMinorVersion)
  install(FILES ${PROJECT_SOURCE_DIR}/cmake/ClearanceConfig.cmake ${PROJECT_BINARY_DIR}/cmake/ClearanceConfigVersion.cmake
    DESTINATION ${_package} COMPONENT ${_component})
endfunction()
