# cmake -DPROGRAM=… -DSOURCE=… -DFILE=… -DUNUSED=… -P: writes the software bill of materials of the
# program: the Debian packages of the libraries that it loads and of packages.txt, section "program",
# but for those of the list UNUSED, with their versions and the licences that their copyright files
# name.
cmake_minimum_required(VERSION 3.25)
set(docs /usr/share/doc)

# Sets `result` to the names of the packages in the section of packages.txt.
function(read_listed_packages result)
  file(READ ${SOURCE}/packages.txt text)
  string(REGEX MATCH "\\[program\\]\n([^\n]+\n)+" section "${text}")
  string(REGEX MATCHALL "\n[a-z0-9][a-z0-9.+-]*" names "${section}")
  list(TRANSFORM names STRIP)
  set(${result} ${names} PARENT_SCOPE)
endfunction()

# Sets `result` to the packages of the libraries that the program loads.
function(find_loaded_packages result)
  file(GET_RUNTIME_DEPENDENCIES EXECUTABLES ${PROGRAM} RESOLVED_DEPENDENCIES_VAR libraries
       UNRESOLVED_DEPENDENCIES_VAR missing)
  set(files)
  foreach(library IN LISTS libraries)
    # dpkg knows a file of /lib by the name that its package has for it: with /usr or without.
    file(REAL_PATH ${library} real)
    string(REGEX REPLACE "^/usr" "" short ${real})
    list(APPEND files ${real} ${short})
  endforeach()
  execute_process(COMMAND dpkg-query -S ${files} OUTPUT_VARIABLE owners ERROR_QUIET)
  string(REGEX MATCHALL "(^|\n)[a-z0-9][a-z0-9.+-]*" names "${owners}")
  list(TRANSFORM names STRIP)
  set(${result} ${names} PARENT_SCOPE)
endfunction()

# Sets `result` to the licences that the copyright file of a package names.
function(read_licences package result)
  set(licences)
  if(EXISTS ${docs}/${package}/copyright)
    file(STRINGS ${docs}/${package}/copyright licences REGEX "^License: *[^ ]")
    list(TRANSFORM licences REPLACE "^License: *" "")
    list(SORT licences)
    list(REMOVE_DUPLICATES licences)
    list(JOIN licences ", " licences)
  endif()
  if(NOT licences)
    set(licences "see ${docs}/${package}/copyright")
  endif()
  set(${result} "${licences}" PARENT_SCOPE)
endfunction()

find_program(dpkg_query dpkg-query)
if(dpkg_query)
  read_listed_packages(listed)
  find_loaded_packages(loaded)
  set(packages ${listed} ${loaded})
  list(SORT packages)
  list(REMOVE_DUPLICATES packages)
  list(REMOVE_ITEM packages ${UNUSED})
  set(text "Debian packages that this program was built from or loads: name, version, licences.\n")
  foreach(package IN LISTS packages)
    execute_process(COMMAND dpkg-query -W -f "\${Version}\\n" ${package}
                    OUTPUT_VARIABLE versions ERROR_QUIET)
    string(REGEX MATCH "^[^\n]*" version "${versions}")  # there is a line for each architecture
    if(version)
      read_licences(${package} licences)
      string(APPEND text "${package} ${version}: ${licences}\n")
    endif()
  endforeach()
else()
  set(text "The packages of this program are not known: it was built on a system without dpkg.\n")
endif()
file(WRITE ${FILE} "${text}")
