# Runs the steps of a user one after the other; the first that fails ends the test.
file(REMOVE_RECURSE ${SCRATCH})
function(step)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()
step(${CMAKE_COMMAND} --install ${BUILD} --prefix ${SCRATCH}/prefix)
# every public header stands where <bilayer/...> finds it, and the command line is there
foreach(path IN ITEMS bin/bilayer include/bilayer/sdf/build.h include/bilayer/sdf/nanovdb.h include/bilayer/integration/fluid/seed.h)
  if(NOT EXISTS ${SCRATCH}/prefix/${path})
    message(FATAL_ERROR "not installed: ${path}")
  endif()
endforeach()
step(${CMAKE_COMMAND} -S ${CONSUMER} -B ${SCRATCH}/build -G ${GENERATOR} -DCMAKE_CXX_COMPILER=${COMPILER}
  "-DCMAKE_CXX_FLAGS=${FLAGS}" -DCMAKE_PREFIX_PATH=${SCRATCH}/prefix)
step(${CMAKE_COMMAND} --build ${SCRATCH}/build)
step(${SCRATCH}/build/consumer)
