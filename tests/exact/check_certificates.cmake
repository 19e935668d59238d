# Writes a few certificates of each class and has them checked.
execute_process(COMMAND ${PROGRAM} --cases 20 --out ${OUT} COMMAND_ERROR_IS_FATAL ANY)
file(GLOB documents ${OUT}/*.json)
execute_process(COMMAND ${PYTHON} ${CHECKER} ${documents} COMMAND_ERROR_IS_FATAL ANY)
