# cpack -G DEB --config build/release/CPackConfig.cmake: a package of Debian (script/package makes it, and tries it).
#   /usr/bin/attrito, the Python packages where Debian's Python looks, the library in a folder of its own below /usr/lib/<triplet>, where
#   `attrito.library.loading` finds it; man page, completion, documentation and example jobs.
#   Dependencies: of the library by dpkg-shlibdeps (OpenBLAS is among them, where CMake found it), of Python those named here; with python/pyproject.toml they say the same.

set(debian_modules lib/python3/dist-packages)
set(debian_documents share/doc/attrito)
set(debian_made ${CMAKE_BINARY_DIR}/debian)

install(TARGETS attrito LIBRARY DESTINATION lib/${CMAKE_LIBRARY_ARCHITECTURE}/attrito COMPONENT debian EXCLUDE_FROM_ALL NAMELINK_SKIP)
# Debian's libraries are where the linker looks.
install(CODE "file(RPATH_REMOVE FILE \$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/lib/${CMAKE_LIBRARY_ARCHITECTURE}/attrito/libattrito.so.${PROJECT_VERSION})"
  COMPONENT debian EXCLUDE_FROM_ALL)
install(DIRECTORY python/attrito python/attrito_verification DESTINATION ${debian_modules} COMPONENT debian EXCLUDE_FROM_ALL
  PATTERN __pycache__ EXCLUDE PATTERN "*.so*" EXCLUDE)
install(FILES ${CMAKE_BINARY_DIR}/metadata/METADATA DESTINATION ${debian_modules}/attrito-${PROJECT_VERSION}.dist-info
  COMPONENT debian EXCLUDE_FROM_ALL)
install(PROGRAMS cmake/debian/attrito DESTINATION bin COMPONENT debian EXCLUDE_FROM_ALL)
install(FILES cmake/debian/completion DESTINATION share/bash-completion/completions RENAME attrito COMPONENT debian EXCLUDE_FROM_ALL)

# The examples keep the folders in which they find each other; documentation is as in the source tree.
install(DIRECTORY input meshes DESTINATION ${debian_documents}/examples COMPONENT debian EXCLUDE_FROM_ALL PATTERN __pycache__ EXCLUDE)
install(DIRECTORY docs/ DESTINATION ${debian_documents}/docs COMPONENT debian EXCLUDE_FROM_ALL
  FILES_MATCHING PATTERN "*.md" PATTERN "*.png" PATTERN "*.svg" PATTERN __pycache__ EXCLUDE)
install(FILES README.md CITATION.cff DESTINATION ${debian_documents} COMPONENT debian EXCLUDE_FROM_ALL)
file(READ LICENSE license)
string(REGEX REPLACE "^.*\n\n(Permission)" " \\1" license "${license}")
string(REGEX REPLACE "\n+$" "" license "${license}")
string(REPLACE "\n\n" "\n.\n" license "${license}")
string(REPLACE "\n" "\n " license "${license}")
configure_file(cmake/debian/copyright.in ${debian_made}/copyright @ONLY)
install(FILES ${debian_made}/copyright DESTINATION ${debian_documents} COMPONENT debian EXCLUDE_FROM_ALL)

set(ATTRITO_MAINTAINER "the attrito developers <maintainers@attrito.invalid>" CACHE STRING "Who is named in the package of Debian")
install(CODE "set(made ${debian_made})
set(source ${CMAKE_SOURCE_DIR})
set(version ${PROJECT_VERSION})
set(maintainer \"${ATTRITO_MAINTAINER}\")
include(${CMAKE_SOURCE_DIR}/cmake/debian/make.cmake)" COMPONENT debian EXCLUDE_FROM_ALL)
install(FILES ${debian_made}/changelog.Debian.gz ${debian_made}/changelog.gz DESTINATION ${debian_documents} COMPONENT debian EXCLUDE_FROM_ALL)
install(FILES ${debian_made}/attrito.1.gz DESTINATION share/man/man1 COMPONENT debian EXCLUDE_FROM_ALL)

set(CPACK_GENERATOR DEB)
set(CPACK_COMPONENTS_ALL debian)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING ALL_COMPONENTS_IN_ONE)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "steady vibration of finite-element structures that rub")
set(CPACK_PACKAGE_CONTACT ${ATTRITO_MAINTAINER})
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_DESCRIPTION
"attrito computes the steady vibration of structures with many friction
contacts, as turbine blades, underplatform dampers and bolted joints. It reads
mass and stiffness matrices of finite-element programs, reduces them onto the
contacts and solves the multi-harmonic balance with its static part. Results
are HDF5 files, with tables, pictures, reports and exports.")
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_DEPENDS "python3 (>= 3.11), python3-h5py-mpi (>= 3.7), python3-matplotlib (>= 3.6), python3-meshio (>= 5.0), python3-mpi4py (>= 3.1), python3-numpy (>= 1:1.24), python3-scipy (>= 1.10), openmpi-bin")
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "python3-argcomplete, python3-pandas")
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "calculix-ccx, gmsh, paraview")
set(CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA ${CMAKE_SOURCE_DIR}/cmake/debian/postinst ${CMAKE_SOURCE_DIR}/cmake/debian/prerm)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
include(CPack)
