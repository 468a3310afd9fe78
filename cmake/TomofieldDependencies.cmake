# Third-party libraries, all from Debian 12 (packages.txt says why each is there).
find_package(OpenMP REQUIRED COMPONENTS CXX)
find_package(Threads REQUIRED)
find_package(hwy REQUIRED)
set(HDF5_PREFER_PARALLEL OFF)
find_package(HDF5 REQUIRED COMPONENTS C)
find_package(PNG REQUIRED)
find_package(kissfft REQUIRED COMPONENTS float SHARED)
find_package(fmt REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(CLI11 REQUIRED)
find_package(tomlplusplus REQUIRED)
find_package(Eigen3 3.3 REQUIRED NO_MODULE)
find_package(PkgConfig REQUIRED)
pkg_check_modules(CBC REQUIRED IMPORTED_TARGET cbc)
find_package(MPI REQUIRED COMPONENTS C)  # its C interface alone

set(TOMOFIELD_LIBRARIES
  OpenMP::OpenMP_CXX Threads::Threads hwy::hwy HDF5::HDF5 PNG::PNG kissfft::kissfft-float fmt::fmt
  nlohmann_json::nlohmann_json $<BUILD_INTERFACE:Eigen3::Eigen> PkgConfig::CBC
  MPI::MPI_C)
set(TOMOFIELD_CLI_LIBRARIES CLI11::CLI11 tomlplusplus::tomlplusplus)

add_library(tomofield_warnings INTERFACE)
target_compile_options(tomofield_warnings INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion -fno-math-errno -ffp-contract=fast)
