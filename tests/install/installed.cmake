# Installs components into a new folder, builds the project against them, and runs the program of its name.
# cmake -DBUILD=build folder -DWORK=scratch folder -DPROJECT=source folder -DCOMPILER=... -DCOMPONENTS=a,b -DARGUMENTS=...,...
#       [-DOPTIONS=...,...] -P installed.cmake
string(REPLACE "," ";" components "${COMPONENTS}")
string(REPLACE "," ";" arguments "${ARGUMENTS}")
string(REPLACE "," ";" options "${OPTIONS}")
get_filename_component(name ${PROJECT} NAME)
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "failed (${result}): ${ARGN}")
  endif()
endfunction()

file(REMOVE_RECURSE ${WORK})
foreach(component IN LISTS components)
  run(${CMAKE_COMMAND} --install ${BUILD} --component ${component} --prefix ${WORK}/prefix)
endforeach()
# Installed files may be moved, because they contain no absolute path.
file(RENAME ${WORK}/prefix ${WORK}/moved)
run(${CMAKE_COMMAND} -S ${PROJECT} -B ${WORK}/build -DCMAKE_PREFIX_PATH=${WORK}/moved -DCMAKE_CXX_COMPILER=${COMPILER} ${options})
run(${CMAKE_COMMAND} --build ${WORK}/build)
run(${WORK}/build/${name} ${arguments})
