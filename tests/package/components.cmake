# SPDX-License-Identifier: Apache-2.0
# find_package(bilayer COMPONENTS ...) where Bullet or OpenCL are not there.
include(${TESTS}/steps.cmake)
set(scratch ${SCRATCH}/components)
function(project_of components)
  file(REMOVE_RECURSE ${scratch})
  file(WRITE ${scratch}/CMakeLists.txt "cmake_minimum_required(VERSION 3.22)\nproject(user LANGUAGES CXX)\n"
    "find_package(bilayer 1.0 REQUIRED COMPONENTS ${components})\n"
    "foreach(component IN ITEMS sdf collider cl bullet fluid)\n  if(TARGET bilayer::\${component})\n"
    "    message(\"has \${component}\")\n  endif()\nendforeach()\n")
endfunction()
function(expect components has)
  project_of("${components}")
  execute_process(COMMAND ${CMAKE_COMMAND} -S ${scratch} -B ${scratch}/build ${toolchain} -DCMAKE_PREFIX_PATH=${prefix} ${ARGN}
    OUTPUT_VARIABLE out ERROR_VARIABLE out RESULT_VARIABLE result)
  string(REGEX MATCHALL "has [a-z]+" found "${out}")
  string(REPLACE "has " "" found "${found}")
  if(NOT "${found}" STREQUAL "${has}" OR NOT result EQUAL 0)
    message(FATAL_ERROR "COMPONENTS ${components} with ${ARGN}: found '${found}', expected '${has}'\n${out}")
  endif()
endfunction()
set(none -DCMAKE_DISABLE_FIND_PACKAGE_OpenCL=ON -DCMAKE_DISABLE_FIND_PACKAGE_Bullet=ON)
expect("sdf" "sdf" ${none})
expect("collider" "sdf;collider" ${none})
expect("fluid" "sdf;collider;fluid" ${none})
expect("cl" "sdf;collider;cl" -DCMAKE_DISABLE_FIND_PACKAGE_Bullet=ON)
expect("bullet" "sdf;collider;bullet" -DCMAKE_DISABLE_FIND_PACKAGE_OpenCL=ON)
expect("" "sdf;collider;cl;bullet;fluid")
expect("sdf OPTIONAL_COMPONENTS bullet cl" "sdf" ${none})
expect("sdf OPTIONAL_COMPONENTS bullet" "sdf;collider;bullet" -DCMAKE_DISABLE_FIND_PACKAGE_OpenCL=ON)
# and what is missing is said
foreach(case IN ITEMS "cl OpenCL" "bullet Bullet" "sfd sfd")
  separate_arguments(case)
  list(GET case 0 component)
  list(GET case 1 missing)
  project_of(${component})
  execute_process(COMMAND ${CMAKE_COMMAND} -S ${scratch} -B ${scratch}/build ${toolchain} -DCMAKE_PREFIX_PATH=${prefix} ${none}
    OUTPUT_VARIABLE out ERROR_VARIABLE out RESULT_VARIABLE result)
  if(result EQUAL 0 OR NOT out MATCHES ${missing})
    message(FATAL_ERROR "COMPONENTS ${component} without it: no error that names ${missing}\n${out}")
  endif()
endforeach()
