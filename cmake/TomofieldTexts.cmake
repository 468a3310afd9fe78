# tomofield_embed_texts(SOURCE HEADER kName=FILE…) lets a source of src/ include a header that has the
# contents of text files, such as the scripts of a page, as constants. Paths count from src/.
function(tomofield_embed_texts source header)
  set(texts)
  set(files)
  foreach(text IN LISTS ARGN)
    string(REGEX MATCH "^([^=]+)=(.+)$" match ${text})
    list(APPEND texts ${CMAKE_MATCH_1}=${PROJECT_SOURCE_DIR}/src/${CMAKE_MATCH_2})
    list(APPEND files ${PROJECT_SOURCE_DIR}/src/${CMAKE_MATCH_2})
  endforeach()
  set(path ${PROJECT_BINARY_DIR}/generated/${header})
  add_custom_command(OUTPUT ${path}
    COMMAND ${CMAKE_COMMAND} -DHEADER=${path} "-DTEXTS=${texts}"
            -P ${PROJECT_SOURCE_DIR}/cmake/WriteTexts.cmake
    DEPENDS ${files} ${PROJECT_SOURCE_DIR}/cmake/WriteTexts.cmake VERBATIM)
  set_source_files_properties(${PROJECT_SOURCE_DIR}/src/${source} PROPERTIES
    INCLUDE_DIRECTORIES ${PROJECT_BINARY_DIR}/generated OBJECT_DEPENDS ${path})
endfunction()
