# SPDX-License-Identifier: Apache-2.0
# How the libraries of bilayer are built, included and installed.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

if(PROJECT_IS_TOP_LEVEL)  # else it is the parent's
  option(BUILD_SHARED_LIBS "Build shared libraries" OFF)
endif()
set(bilayer_components ${BILAYER_COMPONENTS})
set(CMAKE_FIND_PACKAGE_NAME bilayer)
set(bilayer_FIND_REQUIRED TRUE)
include(${CMAKE_CURRENT_LIST_DIR}/dependencies.cmake)
unset(CMAKE_FIND_PACKAGE_NAME)
# A parent project links what the libraries link.
get_property(imported DIRECTORY PROPERTY IMPORTED_TARGETS)
set_target_properties(${imported} PROPERTIES IMPORTED_GLOBAL TRUE)

# What all targets of the project are compiled with.
# The same bytes on every machine and for every number of threads need products and sums that are never fused.
function(bilayer_flags target)
  target_compile_options(${target} PRIVATE -ffp-contract=off -fno-math-errno -Wall -Wextra -Wpedantic $<$<BOOL:${BILAYER_WERROR}>:-Werror>
    # GCC 12 sees overlaps and overflows in std::string that are none (GCC bug 105329 and its like)
    $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict> $<$<CXX_COMPILER_ID:GNU>:-Wno-stringop-overflow>
    # and takes the files of a group for headers, which should not use what is local to a file
    $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR})
  bilayer_group_sources(${target})
endfunction()

# BILAYER_GROUPS: sources are compiled in groups, since reading the headers of one takes most of its time. Alone stay those that
# Highway compiles once for each instruction set, which include themselves, and those that ask a header for its implementation.
function(bilayer_group_sources target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${BILAYER_GROUPS} UNITY_BUILD_BATCH_SIZE 12)
  get_target_property(sources ${target} SOURCES)
  foreach(source IN LISTS sources)
    get_filename_component(path ${source} ABSOLUTE)
    if(EXISTS ${path})
      file(STRINGS ${path} alone REGEX "^#define (HWY_TARGET_INCLUDE|[A-Z]+_IMPLEMENTATION|CATCH_CONFIG_MAIN)")
      if(alone)
        set_source_files_properties(${source} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
      endif()
    endif()
  endforeach()
endfunction()

# For targets that run for moments or wait for the libraries: compiled in half the time. Results are the same bytes, since
# GCC changes no arithmetic at any level.
function(bilayer_mild_optimisation target)
  # where it inlines less, GCC 12 sees null pointers in std::vector that are none
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1> $<$<CXX_COMPILER_ID:GNU>:-Wno-nonnull>)
endfunction()

# bilayer_library(NAME FOLDER LINKS...): a library of all source files of a folder, unless no component of BILAYER_COMPONENTS needs it.
# Headers that stand directly in the folder are public: they are included as <bilayer/FOLDER/...> and installed.
function(bilayer_library name folder)
  if(NOT name IN_LIST bilayer_components)
    return()
  endif()
  cmake_parse_arguments(ARG "" "" "LINKS" ${ARGN})
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${folder}/*.cpp)
  file(GLOB headers CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${folder}/*.h)
  add_library(bilayer_${name} ${sources})
  add_library(bilayer::${name} ALIAS bilayer_${name})
  set_target_properties(bilayer_${name} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON
    VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
  target_compile_features(bilayer_${name} PUBLIC cxx_std_20)
  bilayer_flags(bilayer_${name})
  # links to the public headers alone, as an installed package has them
  set(include ${PROJECT_BINARY_DIR}/include)
  file(REMOVE_RECURSE ${include}/bilayer/${folder})
  file(MAKE_DIRECTORY ${include}/bilayer/${folder})
  foreach(header IN LISTS headers)
    get_filename_component(file ${header} NAME)
    file(CREATE_LINK ${header} ${include}/bilayer/${folder}/${file} SYMBOLIC)
  endforeach()
  target_include_directories(bilayer_${name}
    PUBLIC $<BUILD_INTERFACE:${include}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_link_libraries(bilayer_${name} ${ARG_LINKS})
  if(BILAYER_INSTALL)
    install(TARGETS bilayer_${name} EXPORT bilayer-${name} COMPONENT ${name})
    install(FILES ${headers} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/bilayer/${folder} COMPONENT ${name})
  endif()
endfunction()

# find_package(bilayer COMPONENTS ...) for users.
function(bilayer_install_package)
  set(folder ${CMAKE_INSTALL_LIBDIR}/cmake/bilayer)
  foreach(component IN LISTS bilayer_components)
    install(EXPORT bilayer-${component} NAMESPACE bilayer:: DESTINATION ${folder} COMPONENT ${component})
  endforeach()
  set(cmake ${PROJECT_SOURCE_DIR}/cmake)
  configure_package_config_file(${cmake}/bilayer-config.cmake.in ${PROJECT_BINARY_DIR}/bilayer-config.cmake
    INSTALL_DESTINATION ${folder})
  write_basic_package_version_file(${PROJECT_BINARY_DIR}/bilayer-config-version.cmake COMPATIBILITY SameMinorVersion)
  install(FILES ${PROJECT_BINARY_DIR}/bilayer-config.cmake ${PROJECT_BINARY_DIR}/bilayer-config-version.cmake
    ${cmake}/dependencies.cmake DESTINATION ${folder} COMPONENT sdf)
endfunction()
