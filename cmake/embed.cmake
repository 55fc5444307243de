# bilayer_embed(TARGET FILE): the text of FILE becomes `const char* const bilayer::NAME_cl` inside TARGET.
function(bilayer_embed target file)
  get_filename_component(name ${file} NAME)
  string(MAKE_C_IDENTIFIER ${name} symbol)
  set(output ${CMAKE_BINARY_DIR}/embedded/${symbol}.cpp)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
  file(READ ${file} text)
  file(CONFIGURE OUTPUT ${output} @ONLY
    CONTENT "namespace bilayer {\nextern const char* const @symbol@;\nconst char* const @symbol@ = R\"opencl(@text@)opencl\";\n}\n")
  target_sources(${target} PRIVATE ${output})
endfunction()
