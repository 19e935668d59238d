# clearance_man_page(TARGET SECTION COMPONENT [TARGET...]): the man page of a program, generated from its --help during the
# build, and installed with it. The other targets are programs that its commands run. If the programs cannot be run (another
# processor), there are no pages.
function(clearance_man_page target section component)
  if(CMAKE_CROSSCOMPILING OR CLEARANCE_SANITIZE OR SKBUILD)  # a wheel has no place for them
    return()
  endif()
  get_target_property(_name ${target} OUTPUT_NAME)
  if(NOT _name)
    set(_name ${target})
  endif()
  set(_page ${PROJECT_BINARY_DIR}/man/${_name}.${section}.gz)
  file(MAKE_DIRECTORY ${PROJECT_BINARY_DIR}/man)
  add_custom_command(OUTPUT ${_page}
    COMMAND ${Python_EXECUTABLE} ${PROJECT_SOURCE_DIR}/tools/docs/man_page.py $<TARGET_FILE:${target}> ${section} ${_page}
    DEPENDS ${target} ${ARGN} ${PROJECT_SOURCE_DIR}/tools/docs/man_page.py VERBATIM)
  add_custom_target(${target}_man_page ALL DEPENDS ${_page})
  install(FILES ${_page} DESTINATION ${CMAKE_INSTALL_MANDIR}/man${section} COMPONENT ${component})
endfunction()
