# cpack runs this on the installed files before it packs them. It gives them the documents that Debian
# asks for: compressed man pages, a compressed changelog, and the file "copyright". That file has the
# licences of the packages whose headers the program was compiled with, since they ask for it; the
# libraries that it loads come in packages of their own.
cmake_minimum_required(VERSION 3.25)
set(share ${CPACK_TEMPORARY_INSTALL_DIRECTORY}/usr/share)
set(docs ${share}/doc/tomofield)

file(READ ${docs}/LICENSE copyright)
file(STRINGS ${share}/tomofield/materials.txt packages REGEX "-dev [^:]+: ")
list(TRANSFORM packages REPLACE " .*" "")
foreach(package IN LISTS packages)
  file(READ /usr/share/doc/${package}/copyright licence)
  string(APPEND copyright "\n\n==== The program has code of the headers of ${package}:\n\n${licence}")
endforeach()
file(WRITE ${docs}/copyright "${copyright}")
file(REMOVE ${docs}/LICENSE)

# The changelog of a Debian package has a form of its own, which names versions of the package.
string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)
file(WRITE ${docs}/changelog
"tomofield (${CPACK_PACKAGE_VERSION}) stable; urgency=medium

  * Version ${CPACK_PACKAGE_VERSION}. CHANGELOG.md.gz says what has changed.

 -- ${CPACK_PACKAGE_CONTACT}  ${date}
")
configure_file(${CMAKE_CURRENT_LIST_DIR}/../CHANGELOG.md ${docs} COPYONLY)
file(GLOB pages ${share}/man/man1/*.1)
execute_process(COMMAND gzip -9n ${docs}/changelog ${docs}/CHANGELOG.md ${pages}
                COMMAND_ERROR_IS_FATAL ANY)
