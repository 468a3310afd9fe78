# cpack -G DEB: a Debian package of the component "program". dpkg-shlibdeps says which packages it
# depends on, so it is for the release of Debian on which it was built (tools/package builds it).
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME tomofield)
set(CPACK_PACKAGE_CONTACT "The tomofield authors <maintainers@tomofield.invalid>")
set(CPACK_INSTALL_CMAKE_PROJECTS "${PROJECT_BINARY_DIR};tomofield;program;/")
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_STRIP_FILES ON)
set(CPACK_PRE_BUILD_SCRIPTS ${PROJECT_SOURCE_DIR}/cmake/WriteDebianDocuments.cmake)

set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
if(TOMOFIELD_WITH_MPI)
  set(CPACK_DEBIAN_PACKAGE_SUGGESTS openmpi-bin)  # mpirun, for several processes
endif()
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "tomograms from cryo-ET tilt series as continuous density fields")
set(CPACK_PACKAGE_DESCRIPTION
"tomofield turns an aligned cryo-ET tilt series into a tomogram. It fits a
continuous density field to the views, and runs on ordinary CPU cores. It
takes the projects of IMOD, AreTomo, RELION 5, Warp and SerialEM as they are.
It aligns views, scores volumes, simulates tilt series, compares methods, and
shows models and volumes in a browser.")
include(CPack)
