# What the libraries of bilayer stand on. Read by the project itself and by its installed package.

# Debian keeps FindOpenVDB.cmake beside OpenVDB's other files, where CMake does not look by itself.
foreach(prefix IN ITEMS /usr/lib/${CMAKE_LIBRARY_ARCHITECTURE} /usr/lib /usr/local/lib /usr/lib64)
  if(EXISTS ${prefix}/cmake/OpenVDB/FindOpenVDB.cmake)
    list(APPEND CMAKE_MODULE_PATH ${prefix}/cmake/OpenVDB)
    break()
  endif()
endforeach()

find_package(Threads REQUIRED)
find_package(TBB REQUIRED)
find_package(glm REQUIRED)
find_package(OpenVDB REQUIRED)
find_package(assimp REQUIRED)
find_package(hwy REQUIRED)
find_package(ZLIB REQUIRED)
find_package(fmt REQUIRED)
find_package(OpenCL REQUIRED)

# Bullet's package has no target, and its configuration gives include folders relative to the prefix: wrap it once.
if(NOT TARGET bilayer::packaged_bullet)
  find_package(Bullet MODULE REQUIRED)
  add_library(bilayer::packaged_bullet INTERFACE IMPORTED)
  target_include_directories(bilayer::packaged_bullet SYSTEM INTERFACE ${BULLET_INCLUDE_DIRS})
  target_link_libraries(bilayer::packaged_bullet INTERFACE ${BULLET_LIBRARIES})
endif()
