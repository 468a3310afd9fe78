# cmake --install: the program, the library, its headers and a CMake package.
install(TARGETS tomofield RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
