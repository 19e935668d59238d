# Copies the file IN to OUT with TEXT, which must stand there exactly once, replaced by REPLACEMENT.
file(READ ${IN} source)
string(FIND "${source}" "${TEXT}" first)
string(FIND "${source}" "${TEXT}" last REVERSE)
if(first EQUAL -1 OR NOT first EQUAL last)
  message(FATAL_ERROR "${IN}: expected \"${TEXT}\" exactly once; see clearance_mutated() in tests/CMakeLists.txt")
endif()
string(REPLACE "${TEXT}" "${REPLACEMENT}" source "${source}")
file(WRITE ${OUT} "${source}")
