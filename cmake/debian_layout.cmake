# SPDX-License-Identifier: Apache-2.0
# Run by CPack before it makes packages: moves what is installed where Debian's programs look for it, and adds what each
# package documents.
foreach(group IN ITEMS program development python)
  string(TOUPPER ${group} upper)
  set(folder ${CPACK_TEMPORARY_INSTALL_DIRECTORY}/${group}/usr)
  if(EXISTS ${folder})
    configure_file(${CPACK_RESOURCE_FILE_LICENSE} ${folder}/share/doc/${CPACK_DEBIAN_${upper}_PACKAGE_NAME}/copyright COPYONLY)
  endif()
endforeach()

file(GLOB modules ${CPACK_TEMPORARY_INSTALL_DIRECTORY}/*/usr/lib/python3.*)
foreach(folder IN LISTS modules)
  cmake_path(GET folder PARENT_PATH lib)
  file(GLOB packages ${folder}/*-packages)
  file(MAKE_DIRECTORY ${lib}/python3)
  file(RENAME ${packages} ${lib}/python3/dist-packages)
  file(REMOVE_RECURSE ${folder})
endforeach()
