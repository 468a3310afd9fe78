# cmake --install has three components. "program": the program, its bill of materials, its man pages
# and its licence. "development": the library, its headers and a CMake package. "python": the module.
include(CMakePackageConfigHelpers)
set(tomofield_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/tomofield)

install(TARGETS tomofield RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program)
install(FILES ${tomofield_materials} DESTINATION ${CMAKE_INSTALL_DATADIR}/tomofield COMPONENT program)
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT program)
install(TARGETS tomofield_library EXPORT TomofieldTargets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
install(DIRECTORY include/tomofield ${PROJECT_BINARY_DIR}/include/tomofield
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development FILES_MATCHING PATTERN "*.h")
install(EXPORT TomofieldTargets NAMESPACE tomofield:: DESTINATION ${tomofield_package_dir}
  COMPONENT development)

# The program itself says what its man pages have to say, so a cross-compiled one has none.
if(NOT CMAKE_CROSSCOMPILING)
  set(man_dir ${PROJECT_BINARY_DIR}/man)
  add_custom_command(OUTPUT ${man_dir}/tomofield.1
    COMMAND ${CMAKE_COMMAND} -DPROGRAM=$<TARGET_FILE:tomofield> -DDIRECTORY=${man_dir}
            -DVERSION=${PROJECT_VERSION} -P ${PROJECT_SOURCE_DIR}/cmake/WriteManPages.cmake
    DEPENDS tomofield ${PROJECT_SOURCE_DIR}/cmake/WriteManPages.cmake VERBATIM)
  add_custom_target(tomofield_man_pages ALL DEPENDS ${man_dir}/tomofield.1)
  install(DIRECTORY ${man_dir}/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT program)
endif()

configure_package_config_file(cmake/TomofieldConfig.cmake.in
  ${PROJECT_BINARY_DIR}/cmake/tomofieldConfig.cmake
  INSTALL_DESTINATION ${tomofield_package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/cmake/tomofieldConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES
  ${PROJECT_BINARY_DIR}/cmake/tomofieldConfig.cmake
  ${PROJECT_BINARY_DIR}/cmake/tomofieldConfigVersion.cmake
  DESTINATION ${tomofield_package_dir} COMPONENT development)
