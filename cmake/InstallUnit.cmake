# Writes the unit file for the installation prefix (server/CMakeLists.txt).
get_filename_component(_prefix "${CMAKE_INSTALL_PREFIX}" ABSOLUTE)
set(CMAKE_INSTALL_FULL_BINDIR ${_prefix}/${BINDIR})
if(_prefix STREQUAL "/usr")  # as in GNUInstallDirs
  set(CMAKE_INSTALL_FULL_SYSCONFDIR /${SYSCONFDIR})
else()
  set(CMAKE_INSTALL_FULL_SYSCONFDIR ${_prefix}/${SYSCONFDIR})
endif()
set(_unit $ENV{DESTDIR}${_prefix}/lib/systemd/system/clearanced.service)
message(STATUS "Installing: ${_unit}")
configure_file(${SOURCE} ${_unit} @ONLY)
list(APPEND CMAKE_INSTALL_MANIFEST_FILES ${_unit})
