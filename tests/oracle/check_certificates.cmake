# Checks certificates of each class and kind of motion with the oracle, and some of each class with the checker, too.
file(REMOVE_RECURSE ${OUT})
execute_process(COMMAND ${PROGRAM} --cases 100 --meshes 10 --python 20 --motions 2 --out ${OUT} COMMAND_ERROR_IS_FATAL ANY)
# A case whose spans until first contact have to be shorter than those of the search.
execute_process(COMMAND ${PROGRAM} --class none --motions 1 --first-motion 328 --out ${OUT} COMMAND_ERROR_IS_FATAL ANY)
file(GLOB documents ${OUT}/*.json)
execute_process(COMMAND ${PYTHON} ${CHECKER} ${documents} COMMAND_ERROR_IS_FATAL ANY)
