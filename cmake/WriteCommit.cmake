# cmake -DSOURCE=… -DHEADER=… -P: writes kSourceCommit, `git describe` of the sources at the time of
# the build, and leaves the header alone where it says so already.
cmake_minimum_required(VERSION 3.25)
set(commit unknown)
if(EXISTS ${SOURCE}/.git)  # else the commit may be another project's, around an unpacked archive
  execute_process(COMMAND git --no-optional-locks -C ${SOURCE} describe --always --dirty
                  OUTPUT_VARIABLE described RESULT_VARIABLE status ERROR_QUIET
                  OUTPUT_STRIP_TRAILING_WHITESPACE)
  if(status STREQUAL 0 AND described)
    set(commit ${described})
  endif()
endif()
file(CONFIGURE OUTPUT ${HEADER} CONTENT
"#pragma once
inline constexpr const char* kSourceCommit = \"@commit@\";
" @ONLY)
