# cmake -DPROGRAM=… -DDIRECTORY=… -DVERSION=… -P: writes tomofield.1 and a page a command, such as
# tomofield-export.1, from what the program says to --help, or to --help-all where a command has it.
cmake_minimum_required(VERSION 3.25)

# Sets `result` to the complete help of a command; `words` are its words after `tomofield`.
function(read_help words result)
  execute_process(COMMAND ${PROGRAM} ${words} --help OUTPUT_VARIABLE help COMMAND_ERROR_IS_FATAL ANY)
  if(NOT help MATCHES "\nSubcommands:\n")
    execute_process(COMMAND ${PROGRAM} ${words} --help-all
                    OUTPUT_VARIABLE all RESULT_VARIABLE status ERROR_QUIET)
    if(status EQUAL 0)
      set(help "${all}")
    endif()
  endif()
  set(${result} "${help}" PARENT_SCOPE)
endfunction()

# Sets `result` to the names below "Subcommands:", a list.
function(subcommands_of help result)
  set(names)
  if(help MATCHES "\nSubcommands:\n(.*)")
    string(REGEX MATCHALL "(^|\n)  [a-z][a-z-]*" names "${CMAKE_MATCH_1}")
    list(TRANSFORM names STRIP)
  endif()
  set(${result} ${names} PARENT_SCOPE)
endfunction()

# Sets `result` to a text as the formatter man takes it: headings, options with their texts.
function(to_roff text result)
  string(REPLACE "\\" "\\e" text "${text}")
  string(REPLACE "-" "\\-" text "${text}")
  string(REGEX REPLACE "\n([.'])" "\n\\\\&\\1" text "${text}")
  string(REGEX REPLACE "\n([^ \n][^\n]*):\n" "\n.SS \"\\1\"\n" text "\n${text}")
  set(name "[^ \n]+( [^ \n]+)*")
  string(REGEX REPLACE "\n  (${name})(   *|\n            +)([^ \n])" "\n.TP\n\\\\fB\\1\\\\fR\n\\4"
         text "${text}")
  string(REGEX REPLACE "\n\n+" "\n" text "${text}")
  string(REGEX REPLACE "\n$" "" text "${text}")
  set(${result} "${text}" PARENT_SCOPE)
endfunction()

# Writes the page of a command, then those of its own commands.
function(write_pages words)
  read_help("${words}" help)
  list(JOIN words "-" page)
  string(PREPEND page "tomofield-")
  string(REGEX REPLACE "-$" "" page "${page}")
  if(NOT help MATCHES "^([^\n]+)\nUsage: ([^\n]+)\n(.*)$")
    message(FATAL_ERROR "The help of ${page} does not begin with a sentence and a line 'Usage: …'.")
  endif()
  set(purpose "${CMAKE_MATCH_1}")
  set(usage "${CMAKE_MATCH_2}")
  to_roff("${CMAKE_MATCH_3}" body)
  string(REPLACE "tomofield: " "" purpose "${purpose}")  # the page's name says it
  string(TOUPPER ${page} title)

  subcommands_of("${help}" commands)
  set(related)
  if(words)
    list(APPEND related tomofield)
  endif()
  foreach(command IN LISTS commands)
    list(APPEND related ${page}-${command})
  endforeach()
  list(TRANSFORM related REPLACE "(.+)" ".BR \\1 (1)")
  list(JOIN related "\n" related)

  file(WRITE ${DIRECTORY}/${page}.1
".TH ${title} 1 \"\" \"tomofield ${VERSION}\" \"tomofield\"
.SH NAME
${page} \\- ${purpose}
.SH SYNOPSIS
${usage}
.SH DESCRIPTION${body}
.SH SEE ALSO
${related}
")
  foreach(command IN LISTS commands)
    set(longer ${words} ${command})
    write_pages("${longer}")
  endforeach()
endfunction()

file(REMOVE_RECURSE ${DIRECTORY})
write_pages("")
