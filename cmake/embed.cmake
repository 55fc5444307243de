# SPDX-License-Identifier: Apache-2.0
# The text of FILE with the files that it includes in their places, each once.
function(bilayer_included_text file seen result)
  get_filename_component(folder ${file} DIRECTORY)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
  file(READ ${file} text)
  while(text MATCHES "#include \"([a-z_.]+)\"\n")
    set(line ${CMAKE_MATCH_0})
    set(name ${CMAKE_MATCH_1})
    set(included "")
    if(NOT name IN_LIST seen)
      list(APPEND seen ${name})
      file(READ ${folder}/${name} included)
      set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${folder}/${name})
    endif()
    string(REPLACE "${line}" "${included}" text "${text}")
  endwhile()
  set(${result} "${text}" PARENT_SCOPE)
endfunction()

# bilayer_embed(TARGET FILE): the text of FILE becomes `const char* const bilayer::detail::NAME_cl` inside TARGET, character by
# character: C++ promises no string literal longer than 65,536.
function(bilayer_embed target file)
  get_filename_component(name ${file} NAME)
  string(MAKE_C_IDENTIFIER ${name} symbol)
  set(output ${PROJECT_BINARY_DIR}/embedded/${symbol}.cpp)
  bilayer_included_text(${file} "" text)
  string(HEX "${text}" text)
  string(REGEX REPLACE "(..)" "'\\\\x\\1'," text "${text}")
  file(CONFIGURE OUTPUT ${output} @ONLY
    CONTENT "namespace bilayer::detail {\nnamespace {\nconstexpr char @symbol@_text[] = {@text@0};\n}\nextern const char* const @symbol@;\nconst char* const @symbol@ = @symbol@_text;\n}\n")
  target_sources(${target} PRIVATE ${output})
endfunction()
