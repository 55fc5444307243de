# SPDX-License-Identifier: Apache-2.0
# What the libraries in `bilayer_components` stand on. Read by the project itself and by its installed package.
include(CMakeFindDependencyMacro)

# In the order in which they are loaded: each stands on those before it.
if("cl" IN_LIST bilayer_components OR "bullet" IN_LIST bilayer_components OR "fluid" IN_LIST bilayer_components)
  list(APPEND bilayer_components collider)
endif()
list(APPEND bilayer_components sdf)
set(bilayer_wanted ${bilayer_components})
set(bilayer_components "")
foreach(component IN ITEMS sdf collider cl bullet fluid)
  if(component IN_LIST bilayer_wanted)
    list(APPEND bilayer_components ${component})
  endif()
  list(REMOVE_ITEM bilayer_wanted ${component})
endforeach()
list(APPEND bilayer_components ${bilayer_wanted})  # unknown ones, for the message

set(bilayer_shared ${BUILD_SHARED_LIBS})  # which packages of others set for everybody
find_dependency(Threads)
find_dependency(TBB CONFIG)
find_dependency(glm)
find_dependency(assimp)
find_dependency(hwy)
find_dependency(ZLIB)
find_dependency(fmt)

# Debian keeps FindOpenVDB.cmake next to OpenVDB's other files, where CMake does not look by itself.
set(bilayer_module_path ${CMAKE_MODULE_PATH})
foreach(prefix IN ITEMS /usr/lib/${CMAKE_LIBRARY_ARCHITECTURE} /usr/lib /usr/local/lib /usr/lib64)
  if(EXISTS ${prefix}/cmake/OpenVDB/FindOpenVDB.cmake)
    list(APPEND CMAKE_MODULE_PATH ${prefix}/cmake/OpenVDB)
    break()
  endif()
endforeach()
# Quietly: Debian's Imath reports a missing file for Python, which is not needed here.
set(bilayer_log_level "${CMAKE_MESSAGE_LOG_LEVEL}")
set(CMAKE_MESSAGE_LOG_LEVEL WARNING)
find_package(OpenVDB)
set(CMAKE_MESSAGE_LOG_LEVEL "${bilayer_log_level}")
if(NOT OpenVDB_FOUND)  # an error, or the end of a package that is optional
  find_dependency(OpenVDB)
endif()
set(CMAKE_MODULE_PATH ${bilayer_module_path})
set(BUILD_SHARED_LIBS ${bilayer_shared})

if("collider" IN_LIST bilayer_components)
  find_dependency(Qhull CONFIG)
endif()
if("cl" IN_LIST bilayer_components)
  find_dependency(OpenCL)
endif()
# Bullet's package has no target, and its configuration gives include folders relative to the prefix: wrap it once.
if("bullet" IN_LIST bilayer_components AND NOT TARGET bilayer::packaged_bullet)
  find_dependency(Bullet MODULE)
  add_library(bilayer::packaged_bullet INTERFACE IMPORTED)
  target_include_directories(bilayer::packaged_bullet SYSTEM INTERFACE ${BULLET_INCLUDE_DIRS})
  target_link_libraries(bilayer::packaged_bullet INTERFACE ${BULLET_LIBRARIES})
endif()
