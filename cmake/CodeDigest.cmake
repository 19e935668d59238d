# cmake -DOUT=HEADER -DNAME=CONSTANT -DBESIDE=TEXT -P CodeDigest.cmake -- FILE...
# Writes a header with a digest of all files and of a text (the libraries' versions).
set(_digests "${BESIDE}")
set(_files OFF)
math(EXPR _last "${CMAKE_ARGC} - 1")
foreach(_i RANGE ${_last})
  if(_files)
    file(SHA256 "${CMAKE_ARGV${_i}}" _digest)
    get_filename_component(_name "${CMAKE_ARGV${_i}}" NAME)
    string(APPEND _digests "\n${_digest} ${_name}")
  elseif("${CMAKE_ARGV${_i}}" STREQUAL "--")
    set(_files ON)
  endif()
endforeach()
string(SHA256 _digest "${_digests}")
file(WRITE "${OUT}" "// Made by cmake/CodeDigest.cmake.
#pragma once

namespace clearance {

inline constexpr const char* ${NAME} = \"${_digest}\";

}  // namespace clearance
")
