# SPDX-License-Identifier: Apache-2.0
# Files for pkg-config, and Debian packages by CPack. docs/packages.md describes both.

# bilayer_pkgconfig(NAME DESCRIPTION PUBLIC... PRIVATE... LIBS...): bilayer-NAME.pc. PUBLIC and PRIVATE are the modules of pkg-config
# that the headers and the library stand on; LIBS are flags of the linker for what has no module. A static library is linked with
# all of them.
function(bilayer_pkgconfig name description)
  if(NOT TARGET bilayer_${name})
    return()
  endif()
  cmake_parse_arguments(ARG "" "" "PUBLIC;PRIVATE;LIBS" ${ARGN})
  set(modules ${ARG_PUBLIC})
  if(NOT BUILD_SHARED_LIBS)
    list(APPEND modules ${ARG_PRIVATE})
  endif()
  list(JOIN modules " " modules)
  list(JOIN ARG_LIBS " " libs)
  set(folder ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
  file(RELATIVE_PATH prefix /${folder} /)  # so that the installed files may be moved
  set(file ${PROJECT_BINARY_DIR}/pkgconfig/bilayer-${name}.pc)
  string(CONCAT text
    "prefix=\${pcfiledir}/${prefix}\n"
    "libdir=\${prefix}/${CMAKE_INSTALL_LIBDIR}\n"
    "includedir=\${prefix}/${CMAKE_INSTALL_INCLUDEDIR}\n\n"
    "Name: bilayer-${name}\n"
    "Description: ${description}\n"
    "Version: ${PROJECT_VERSION}\n"
    "Requires: ${modules}\n"
    "Cflags: -I\${includedir}\n"
    "Libs: -L\${libdir} -lbilayer_${name} ${libs}\n")
  file(WRITE ${file} "${text}")
  install(FILES ${file} DESTINATION ${folder} COMPONENT ${name})
endfunction()

bilayer_pkgconfig(sdf "Signed distance fields from triangle meshes" PUBLIC glm PRIVATE tbb assimp libhwy zlib fmt Imath
  LIBS -lopenvdb -pthread)
bilayer_pkgconfig(collider "Queries and contacts on signed distance fields" PUBLIC bilayer-sdf PRIVATE tbb qhull_r)
bilayer_pkgconfig(cl "Signed distance fields on OpenCL devices" PUBLIC bilayer-collider PRIVATE OpenCL tbb)
bilayer_pkgconfig(bullet "Bodies with signed distance fields in Bullet" PUBLIC bilayer-collider bullet PRIVATE tbb)
bilayer_pkgconfig(fluid "Liquids and obstacles on OpenVDB grids" PUBLIC bilayer-collider Imath tbb PRIVATE fmt LIBS -lopenvdb)

# Packages: one for each group of components.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME bilayer)
set(CPACK_PACKAGE_VENDOR "the authors of bilayer")
set(CPACK_PACKAGE_CONTACT "the authors of bilayer <maintainers@bilayer.invalid>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING ONE_PER_GROUP)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
# Debian packages whose headers have code that is compiled in. The file `copyright` of our packages has their notices.
set(BILAYER_COMPILED_IN
  libopenvdb-dev libnanovdb-dev libtbb-dev libhwy-dev libglm-dev libfmt-dev libimath-dev libassimp-dev libbullet-dev libtinygltf-dev
  nlohmann-json3-dev libfast-float-dev opencl-c-headers opencl-clhpp-headers libcli11-dev pybind11-dev)
set(CPACK_BILAYER_COMPILED_IN ${BILAYER_COMPILED_IN})  # for the script, which sees only variables of CPack
set(CPACK_PRE_BUILD_SCRIPTS ${PROJECT_SOURCE_DIR}/cmake/debian_layout.cmake)

set(CPACK_DEBIAN_PROGRAM_DESCRIPTION
  "The command line. It builds narrow-band signed distance fields in OpenVDB files, reports defects of meshes, and seeds liquids.")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME bilayer)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_DEVELOPMENT_DESCRIPTION
  "Headers and static libraries for fields, queries, contacts in Bullet, liquids, and OpenCL devices.")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libbilayer-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
# What cmake/dependencies.cmake looks for, in the versions that the static libraries are compiled with, or newer. Names of OpenVDB's
# code have its major and minor version, and other versions of Bullet's classes have other sizes: those two may only have another
# patch.
set(depends)
foreach(package IN ITEMS libopenvdb-dev libboost-iostreams-dev libblosc-dev libtbb-dev libassimp-dev libhwy-dev libqhull-dev libglm-dev
    libfmt-dev libimath-dev zlib1g-dev libbullet-dev ocl-icd-opencl-dev opencl-clhpp-headers)
  execute_process(COMMAND dpkg-query --show --showformat=\${source:Upstream-Version} ${package} OUTPUT_VARIABLE version ERROR_QUIET)
  if(version MATCHES "^([0-9]+)\\.([0-9]+)")
    list(APPEND depends "${package} (>= ${CMAKE_MATCH_1}.${CMAKE_MATCH_2}~)")
    math(EXPR next_minor "${CMAKE_MATCH_2} + 1")
    if(package STREQUAL "libopenvdb-dev" OR package STREQUAL "libbullet-dev")
      list(APPEND depends "${package} (<< ${CMAKE_MATCH_1}.${next_minor}~)")
    endif()
  else()
    list(APPEND depends ${package})
  endif()
endforeach()
list(JOIN depends ", " CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS)
set(CPACK_DEBIAN_PYTHON_DESCRIPTION
  "The Python module: fields, queries, contacts and liquids on numpy arrays.")
set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-bilayer)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA
  ${PROJECT_SOURCE_DIR}/packaging/debian/postinst ${PROJECT_SOURCE_DIR}/packaging/debian/prerm)
set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
  "python3 (>= ${BILAYER_PYTHON_VERSION}), python3 (<< ${BILAYER_PYTHON_VERSION}.99), python3-numpy")

set(CPACK_COMPONENTS_ALL ${bilayer_components})
if(BILAYER_TOOLS)
  list(APPEND CPACK_COMPONENTS_ALL tools)
endif()
if(TARGET bilayer_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
endif()
include(CPack)
foreach(component IN LISTS bilayer_components)
  cpack_add_component(${component} GROUP development)
endforeach()
cpack_add_component(tools GROUP program)
cpack_add_component(python GROUP python)
