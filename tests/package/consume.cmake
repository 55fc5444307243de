# SPDX-License-Identifier: Apache-2.0
include(${TESTS}/steps.cmake)
set(build ${SCRATCH}/consumer)
file(REMOVE_RECURSE ${build})
step(${CMAKE_COMMAND} -S ${TESTS}/consumer -B ${build} ${toolchain} -DCMAKE_PREFIX_PATH=${prefix})
step(${CMAKE_COMMAND} --build ${build})
step(${build}/consumer)
