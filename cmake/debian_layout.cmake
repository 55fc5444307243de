# SPDX-License-Identifier: Apache-2.0
# Run by CPack before it makes packages: moves what is installed where Debian's programs look for it, and adds what each
# package documents: the licence of bilayer, the notices of the libraries of which code is compiled in, and the version.
file(READ ${CPACK_RESOURCE_FILE_LICENSE} licence)
string(CONCAT copyright "bilayer is under the Apache License 2.0:\n\n${licence}\n"
  "Code of the headers of the following Debian packages is compiled in. Their notices, as these packages state them:\n")
foreach(package IN LISTS CPACK_BILAYER_COMPILED_IN)
  set(file /usr/share/doc/${package}/copyright)
  if(NOT EXISTS ${file})
    message(FATAL_ERROR "the notice of ${package} is missing: there is no ${file}")
  endif()
  file(READ ${file} notice)
  string(REPEAT "=" 80 line)
  string(APPEND copyright "\n${line}\n${package}\n${line}\n\n${notice}")
endforeach()

# the time is that of SOURCE_DATE_EPOCH
string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)
set(version ${CPACK_PACKAGE_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE})
set(changelog "bilayer (${version}) bookworm; urgency=medium\n\n  * Version ${CPACK_PACKAGE_VERSION}.\n\n")
string(APPEND changelog " -- ${CPACK_PACKAGE_CONTACT}  ${date}\n")

foreach(group IN ITEMS program development python)
  string(TOUPPER ${group} upper)
  set(folder ${CPACK_TEMPORARY_INSTALL_DIRECTORY}/${group}/usr)
  if(EXISTS ${folder})
    set(documents ${folder}/share/doc/${CPACK_DEBIAN_${upper}_PACKAGE_NAME})
    file(WRITE ${documents}/copyright "${copyright}")
    file(WRITE ${documents}/changelog.Debian "${changelog}")
    execute_process(COMMAND gzip -9n ${documents}/changelog.Debian COMMAND_ERROR_IS_FATAL ANY)
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
