# The Debian package: `cpack` in the build folder. Everything except Python, in one package.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME clearance)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY ${PROJECT_DESCRIPTION})
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/package)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL client server client_library engine_library)
set(CPACK_COMPONENTS_GROUPING ALL_COMPONENTS_IN_ONE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CLEARANCE_MAINTAINER "Clearance developers <clearance@example.org>" CACHE STRING
  "Whom the Debian package names: whoever builds it for others gives a name and address of theirs")
set(CPACK_DEBIAN_PACKAGE_MAINTAINER ${CLEARANCE_MAINTAINER})
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_DEPENDS "adduser, procps")  # procps: /bin/kill, which the unit uses to reload
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)  # derives dependencies from linked libraries
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA
  ${PROJECT_SOURCE_DIR}/cmake/debian/postinst ${PROJECT_SOURCE_DIR}/cmake/debian/prerm ${PROJECT_SOURCE_DIR}/cmake/debian/postrm)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION share/doc/clearance RENAME copyright COMPONENT server)
include(CPack)
