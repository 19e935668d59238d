# The Python package in build/python/clearance, and a function for its extension modules. Included at the top level,
# because nanobind's functions read variables of the folder that found it.
execute_process(COMMAND ${Python_EXECUTABLE} -m nanobind --cmake_dir
  OUTPUT_VARIABLE nanobind_ROOT OUTPUT_STRIP_TRAILING_WHITESPACE RESULT_VARIABLE _nanobind_missing)
if(_nanobind_missing)
  message(FATAL_ERROR "nanobind was not found: ${Python_EXECUTABLE} -m pip install nanobind, or leave the Python package "
                      "out (-DCLEARANCE_BUILD_PYTHON=OFF).")
endif()
find_package(nanobind 2.0 CONFIG REQUIRED)

set(CLEARANCE_PYTHON_DIR ${PROJECT_BINARY_DIR}/python/clearance)

# clearance_python_module(name sources... LIBS libraries...): an extension module of the package.
function(clearance_python_module name)
  cmake_parse_arguments(ARG "" "" "LIBS" ${ARGN})
  # STABLE_ABI: with Python 3.12 and later, one module for all of them (tools/wheel.sh).
  # A separate domain: both modules bind a Query and an Answer, and share a process with others' nanobind modules.
  nanobind_add_module(${name} NB_STATIC STABLE_ABI NB_DOMAIN clearance${name} NOMINSIZE NB_SUPPRESS_WARNINGS
    ${ARG_UNPARSED_ARGUMENTS})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE clearance_options ${ARG_LIBS})
  foreach(_library nanobind-static nanobind-static-abi3)  # compiled as one, once for all modules
    if(TARGET ${_library})
      set_target_properties(${_library} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)
    endif()
  endforeach()
  # Exports PyInit_ alone, because the module shares a process with other builds of the same libraries. The script also
  # hides instantiations from the standard library's headers.
  target_link_options(${name} PRIVATE LINKER:--exclude-libs,ALL
    LINKER:--version-script,${PROJECT_SOURCE_DIR}/cmake/python_module.map)
  set_target_properties(${name} PROPERTIES
    LIBRARY_OUTPUT_DIRECTORY ${CLEARANCE_PYTHON_DIR} LINK_DEPENDS ${PROJECT_SOURCE_DIR}/cmake/python_module.map)
  if(SKBUILD)
    install(TARGETS ${name} LIBRARY DESTINATION ${SKBUILD_PLATLIB_DIR}/clearance COMPONENT python)
  endif()
endfunction()
