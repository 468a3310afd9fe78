# Defines one target a folder of src/: tomofield_base, tomofield_io, …
#
# src/layers.txt has their order. A layer is compiled with an include folder of its own, which has
# links to the layer itself and to those before it. So an include of a later layer finds no file.
set(layers_file ${PROJECT_SOURCE_DIR}/src/layers.txt)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${layers_file})
file(STRINGS ${layers_file} tomofield_layers REGEX "^[a-z_]+$")

file(GLOB folders CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/*)
foreach(folder IN LISTS folders)
  get_filename_component(layer ${folder} NAME)
  file(GLOB_RECURSE files ${folder}/*.h ${folder}/*.cc)
  if(IS_DIRECTORY ${folder} AND files AND NOT layer IN_LIST tomofield_layers)
    message(FATAL_ERROR "src/${layer} has no place in src/layers.txt; write it there.")
  endif()
endforeach()

# Every layer's include folder ends in src, so that compilers, editors and clang-tidy show src/….
set(tomofield_layers_dir ${PROJECT_BINARY_DIR}/layers)
file(REMOVE_RECURSE ${tomofield_layers_dir})
set(visible_layers)
foreach(layer IN LISTS tomofield_layers)
  list(APPEND visible_layers ${layer})
  file(MAKE_DIRECTORY ${tomofield_layers_dir}/${layer}/src)
  foreach(visible IN LISTS visible_layers)
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
set_source_files_properties(${PROJECT_SOURCE_DIR}/src/io/star_parser.cc PROPERTIES
  COMPILE_OPTIONS -std=c++17 SKIP_PRECOMPILE_HEADERS ON)

# The presets compile eight sources of a layer at a time (CMAKE_UNITY_BUILD), which halves the time of
# a clean build. The sources of kernels include themselves once for each instruction set, and these
# have a name in their unnamed namespace that another source of their layer has as well.
set(sources_alone
  align/axis_search.cc align/bead_alignment.cc batch/task.cc evaluate/field_artefacts.cc
  evaluate/similarity.cc field/vm/vm_field.cc io/ctffind_table.cc io/hdf5_reader.cc io/star_parser.cc
  objective/ray_data_term.cc projects/imod_project.cc report/slice.cc simulate/rasterize.cc
  tilt_series/band_limited_image.cc
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
  # base/parallel.h alone starts threads: with Eigen's own, sums would depend on their number.
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
