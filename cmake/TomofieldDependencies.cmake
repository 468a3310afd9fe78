# Third-party libraries, all from Debian 12 (packages.txt says why each is there).
find_package(Threads REQUIRED)
find_package(hwy REQUIRED)
set(HDF5_PREFER_PARALLEL OFF)
find_package(HDF5 REQUIRED COMPONENTS C)
find_package(PNG REQUIRED)
find_package(TIFF 4.5 REQUIRED)
find_package(pugixml REQUIRED)
find_path(GEMMI_INCLUDE_DIR gemmi/cif.hpp REQUIRED)  # headers alone, as is what it includes:
find_path(PEGTL_INCLUDE_DIR tao/pegtl.hpp REQUIRED)
find_package(PkgConfig REQUIRED)
pkg_check_modules(TURBOJPEG REQUIRED IMPORTED_TARGET libturbojpeg)
find_package(kissfft REQUIRED COMPONENTS float SHARED)
pkg_check_modules(LZMA REQUIRED IMPORTED_TARGET liblzma)
find_package(fmt REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(CLI11 REQUIRED)
find_package(tomlplusplus REQUIRED)
find_package(Eigen3 3.3 REQUIRED NO_MODULE)

# Every layer may use these; they are also what the common precompiled headers need.
set(TOMOFIELD_COMMON_LIBRARIES
  Threads::Threads fmt::fmt nlohmann_json::nlohmann_json)

# The layer of that name alone compiles against these.
set(TOMOFIELD_fourier_LIBRARIES kissfft::kissfft-float)
set(TOMOFIELD_io_LIBRARIES HDF5::HDF5 PNG::PNG PkgConfig::TURBOJPEG TIFF::TIFF pugixml::pugixml)
set(TOMOFIELD_kernels_LIBRARIES hwy::hwy)
set(TOMOFIELD_tilt_series_LIBRARIES $<BUILD_INTERFACE:Eigen3::Eigen>)
set(TOMOFIELD_field_LIBRARIES $<BUILD_INTERFACE:Eigen3::Eigen>)
set(TOMOFIELD_objective_LIBRARIES kissfft::kissfft-float)
set(TOMOFIELD_align_LIBRARIES $<BUILD_INTERFACE:Eigen3::Eigen>)
set(TOMOFIELD_compact_LIBRARIES $<BUILD_INTERFACE:Eigen3::Eigen> PkgConfig::LZMA)
set(TOMOFIELD_tune_LIBRARIES $<BUILD_INTERFACE:Eigen3::Eigen>)
set(TOMOFIELD_verdict_LIBRARIES $<BUILD_INTERFACE:Eigen3::Eigen>)
set(TOMOFIELD_evaluate_LIBRARIES kissfft::kissfft-float)
set(TOMOFIELD_baseline_LIBRARIES kissfft::kissfft-float)
set(TOMOFIELD_cli_LIBRARIES CLI11::CLI11 tomlplusplus::tomlplusplus)

set(TOMOFIELD_UNUSED_PACKAGES)  # of packages.txt, for the bill of materials
if(TOMOFIELD_WITH_MPI)
  find_package(MPI REQUIRED COMPONENTS C)  # its C interface alone
  set(TOMOFIELD_distributed_LIBRARIES MPI::MPI_C)
else()
  list(APPEND TOMOFIELD_UNUSED_PACKAGES libopenmpi-dev)
endif()
if(TOMOFIELD_WITH_CBC)
  pkg_check_modules(CBC REQUIRED IMPORTED_TARGET cbc)
  set(TOMOFIELD_fit_LIBRARIES PkgConfig::CBC)
else()
  list(APPEND TOMOFIELD_UNUSED_PACKAGES coinor-libcbc-dev)
endif()
if(TOMOFIELD_WITH_FFTW)
  pkg_check_modules(FFTW REQUIRED IMPORTED_TARGET fftw3f)
  set(TOMOFIELD_fourier_LIBRARIES PkgConfig::FFTW)
else()
  list(APPEND TOMOFIELD_UNUSED_PACKAGES libfftw3-dev)
endif()

set(names_warnings -Wshadow)
if(CMAKE_UNITY_BUILD AND CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  # Sources that are compiled together see the names of each other's unnamed namespaces.
  set(names_warnings -Wshadow=local -Wno-subobject-linkage)
endif()
add_library(tomofield_warnings INTERFACE)
target_compile_options(tomofield_warnings INTERFACE
  -Wall -Wextra -Wpedantic ${names_warnings} -Wconversion -Wno-sign-conversion
  $<$<BOOL:${TOMOFIELD_WERROR}>:-Werror> -fno-math-errno -ffp-contract=fast)
