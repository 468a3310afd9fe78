# Defines one target a room (folder) of src/: tomofield_base, tomofield_io, …
#
# src/layers.txt has their graph. A room is compiled with an include folder of its own, which has links
# to the room itself, to those that its line names, and to those that their headers may include in
# turn. So an include of any other room finds no file. tests/layers/check_layers.py refuses those that
# are found although the line of the room does not name them.
set(layers_file ${PROJECT_SOURCE_DIR}/src/layers.txt)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${layers_file})
file(STRINGS ${layers_file} layer_lines REGEX "^[a-z_]+:")
set(tomofield_layers)
foreach(line IN LISTS layer_lines)
  string(REGEX MATCHALL "[a-z_]+" visible ${line})
  list(POP_FRONT visible layer)
  list(APPEND tomofield_layers ${layer})
  set(visible_${layer} ${layer})
  foreach(included IN LISTS visible)
    if(NOT included IN_LIST tomofield_layers)
      message(FATAL_ERROR "src/layers.txt: '${layer}' names '${included}', which has no line above it.")
    endif()
    list(APPEND visible_${layer} ${visible_${included}})
  endforeach()
  list(REMOVE_DUPLICATES visible_${layer})
endforeach()

file(GLOB folders CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/*)
foreach(folder IN LISTS folders)
  get_filename_component(layer ${folder} NAME)
  file(GLOB_RECURSE files ${folder}/*.h ${folder}/*.cc)
  if(IS_DIRECTORY ${folder} AND files AND NOT layer IN_LIST tomofield_layers)
    message(FATAL_ERROR "src/${layer} has no line in src/layers.txt; write it there.")
  endif()
endforeach()

# Every layer's include folder ends in src, so that compilers, editors and clang-tidy show src/….
set(tomofield_layers_dir ${PROJECT_BINARY_DIR}/layers)
file(REMOVE_RECURSE ${tomofield_layers_dir})
foreach(layer IN LISTS tomofield_layers)
  file(MAKE_DIRECTORY ${tomofield_layers_dir}/${layer}/src)
  foreach(visible IN LISTS visible_${layer})
    file(CREATE_LINK ${PROJECT_SOURCE_DIR}/src/${visible}
      ${tomofield_layers_dir}/${layer}/src/${visible} SYMBOLIC)
  endforeach()
endforeach()

# These sources stand in for an optional library, or need it.
if(TOMOFIELD_WITH_MPI)
  set(unused_sources distributed/communicator_alone.cc)
else()
  set(unused_sources distributed/communicator_mpi.cc)
endif()
if(TOMOFIELD_WITH_CBC)
  list(APPEND unused_sources fit/integer_program_absent.cc)
else()
  list(APPEND unused_sources fit/integer_program.cc)
endif()
if(TOMOFIELD_WITH_FFTW)
  list(APPEND unused_sources fourier/image_transform_kissfft.cc fourier/real_transform_kissfft.cc)
else()
  list(APPEND unused_sources fourier/image_transform_fftw.cc fourier/real_transform_fftw.cc)
endif()
list(TRANSFORM unused_sources PREPEND ${PROJECT_SOURCE_DIR}/src/)

# The head of this source says why.
set_source_files_properties(${PROJECT_SOURCE_DIR}/src/io/tables/star_parser.cc PROPERTIES
  COMPILE_OPTIONS -std=c++17 SKIP_PRECOMPILE_HEADERS ON)

# The presets compile eight sources of a layer at a time (CMAKE_UNITY_BUILD), which halves the time of
# a clean build. The sources of kernels include themselves once for each instruction set, and these
# have a name in their unnamed namespace that another source of their layer has as well.
set(sources_alone
  align/start/axis_search.cc align/beads/bead_alignment.cc batch/task.cc evaluate/field_artefacts.cc
  evaluate/similarity.cc field/vm/vm_field.cc io/tables/ctffind_table.cc io/hdf5/hdf5_reader.cc
  io/tables/star_parser.cc objective/ray_data_term.cc projects/imod_project.cc report/slice.cc simulate/rasterize.cc
  tilt_series/resampling/band_limited_image.cc
  tilt_series/fixed_pattern/pixel_pattern.cc tilt_series/masks/straight_fill.cc)
list(TRANSFORM sources_alone PREPEND ${PROJECT_SOURCE_DIR}/src/)
set_source_files_properties(${sources_alone} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
set(layers_alone kernels)

# Sets `result` to the sources of a layer that this build has, without its unit tests.
function(tomofield_layer_sources layer result)
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/${layer}/*.cc)
  list(FILTER sources EXCLUDE REGEX "_test\\.cc$")
  list(REMOVE_ITEM sources ${unused_sources})
  set(${result} ${sources} PARENT_SCOPE)
endfunction()

# Gives a target the include folder, the libraries and the definitions of a layer.
function(tomofield_compile_as_layer target layer)
  target_include_directories(${target} PRIVATE
    ${tomofield_layers_dir}/${layer}/src ${PROJECT_SOURCE_DIR}/include ${PROJECT_BINARY_DIR}/include)
  # base/threads/parallel.h alone starts threads: with Eigen's own, sums would depend on their
  # number.
  target_compile_definitions(${target} PRIVATE
    TOMOFIELD_VERSION="${PROJECT_VERSION}" EIGEN_DONT_PARALLELIZE)
  target_link_libraries(${target} PRIVATE
    tomofield_warnings ${TOMOFIELD_COMMON_LIBRARIES} ${TOMOFIELD_${layer}_LIBRARIES})
endfunction()

# Defines the object library tomofield_<layer>. The first one compiles the precompiled headers, which
# the others use as well.
function(tomofield_add_layer layer)
  tomofield_layer_sources(${layer} sources)
  add_library(tomofield_${layer} OBJECT ${sources})
  if(layer IN_LIST layers_alone)
    set_target_properties(tomofield_${layer} PROPERTIES UNITY_BUILD OFF)
  endif()
  tomofield_compile_as_layer(tomofield_${layer} ${layer})
  list(GET tomofield_layers 0 first_layer)
  if(layer STREQUAL first_layer)
    target_precompile_headers(tomofield_${layer} PRIVATE ${tomofield_common_headers})
  else()
    target_precompile_headers(tomofield_${layer} REUSE_FROM tomofield_${first_layer})
  endif()
endfunction()
