# Precompiled headers that are expensive to compile and never change. tests/modules finds a file that lacks an include of
# its own.

# clearance_use_standard_headers(target [source...]): the standard library's. The named sources have flags of their own, which
# a precompiled header would have to share, and are compiled without it.
function(clearance_use_standard_headers target)
  target_precompile_headers(${target} PRIVATE <algorithm> <array> <atomic> <charconv> <chrono> <cmath> <cstdint>
    <cstring> <deque> <filesystem> <functional> <limits> <map> <memory> <mutex> <optional> <span> <sstream> <stdexcept> <string>
    <string_view> <thread> <unordered_map> <utility> <variant> <vector>)
  set_source_files_properties(${ARGN} PROPERTIES SKIP_PRECOMPILE_HEADERS ON)
endfunction()

# clearance_use_cli11(target [source...]): links CLI11 into a program whose options those sources read (all of its sources,
# if none is named).
#
# The header takes the compiler eight seconds, so it is precompiled once for all of them. Each source that includes it also
# compiles its inline code, which takes as long again at -O3; parsing options need not be fast: -O1. Sources that read none
# get neither. (Not for targets with OpenMP, because GCC rejects a header that was compiled without it.)
function(clearance_use_cli11 target)
  find_package(CLI11 REQUIRED)
  target_link_libraries(${target} PRIVATE CLI11::CLI11)
  if(NOT TARGET clearance_cli11_headers)
    add_executable(clearance_cli11_headers ${PROJECT_SOURCE_DIR}/cmake/headers.cpp)
    set_target_properties(clearance_cli11_headers PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/cmake)
    target_link_libraries(clearance_cli11_headers PRIVATE clearance_options CLI11::CLI11)
    target_compile_options(clearance_cli11_headers PRIVATE $<$<CONFIG:Release>:-O1>)
    target_precompile_headers(clearance_cli11_headers PRIVATE <CLI/CLI.hpp>)
  endif()
  target_precompile_headers(${target} REUSE_FROM clearance_cli11_headers)
  get_target_property(_sources ${target} SOURCES)
  set(_readers ${ARGN})
  if(NOT _readers)
    set(_readers ${_sources})
  endif()
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)  # not for sources, which would not be joined
  list(REMOVE_ITEM _sources ${_readers})
  if(_sources)
    set_source_files_properties(${_sources} PROPERTIES SKIP_PRECOMPILE_HEADERS ON COMPILE_OPTIONS $<$<CONFIG:Release>:-O3>)
  endif()
endfunction()

# clearance_join_sources(target [most]): compiles the target's sources several at a time, at most `most` (8), so that their
# includes are read once for all of them. Only with CLEARANCE_JOIN_SOURCES; otherwise each source is compiled alone, which
# finds a file that lacks an include of its own.
function(clearance_join_sources target)
  set(_most ${ARGN} 8)
  list(GET _most 0 _most)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${CLEARANCE_JOIN_SOURCES} UNITY_BUILD_BATCH_SIZE ${_most})
endfunction()

# clearance_join_group(target group source...): the same for these sources alone, all at a time.
function(clearance_join_group target group)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${CLEARANCE_JOIN_SOURCES} UNITY_BUILD_MODE GROUP)
  set_source_files_properties(${ARGN} PROPERTIES UNITY_GROUP ${group})
endfunction()
