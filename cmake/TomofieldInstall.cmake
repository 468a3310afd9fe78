# cmake --install: the program, the library, its headers and a CMake package.
include(CMakePackageConfigHelpers)
set(tomofield_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/tomofield)

install(TARGETS tomofield RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(TARGETS tomofield_library EXPORT TomofieldTargets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY include/tomofield ${PROJECT_BINARY_DIR}/include/tomofield
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")
install(EXPORT TomofieldTargets NAMESPACE tomofield:: DESTINATION ${tomofield_package_dir})

configure_package_config_file(cmake/TomofieldConfig.cmake.in
  ${PROJECT_BINARY_DIR}/cmake/tomofieldConfig.cmake
  INSTALL_DESTINATION ${tomofield_package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/cmake/tomofieldConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES
  ${PROJECT_BINARY_DIR}/cmake/tomofieldConfig.cmake
  ${PROJECT_BINARY_DIR}/cmake/tomofieldConfigVersion.cmake
  DESTINATION ${tomofield_package_dir})
