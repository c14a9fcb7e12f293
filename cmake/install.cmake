# cmake --install build/release --prefix P: the command P/bin/attrito, P/lib/attrito with the package `attrito`, its library and
#   `attrito_verification` (`attrito verify`), and the C header P/include/attrito.h.
#   Python finds the package with PYTHONPATH=P/lib/attrito; the command needs nothing set.

set(place lib/attrito)
set_target_properties(attrito PROPERTIES INSTALL_RPATH_USE_LINK_PATH ON)
install(TARGETS attrito LIBRARY DESTINATION ${place}/attrito)
install(FILES src/api/attrito.h DESTINATION include)
install(DIRECTORY python/attrito python/attrito_verification DESTINATION ${place} PATTERN __pycache__ EXCLUDE PATTERN "*.so*" EXCLUDE)

# What importlib.metadata reads the version from.
file(CONFIGURE OUTPUT metadata/METADATA CONTENT "Metadata-Version: 2.1\nName: attrito\nVersion: ${PROJECT_VERSION}\n")
install(FILES ${CMAKE_BINARY_DIR}/metadata/METADATA DESTINATION ${place}/attrito-${PROJECT_VERSION}.dist-info)

set(ATTRITO_PYTHON /usr/bin/python3 CACHE FILEPATH "The Python that the installed command runs with; it sees mpi4py and h5py")
configure_file(cmake/attrito.in bin/attrito @ONLY)
install(PROGRAMS ${CMAKE_BINARY_DIR}/bin/attrito DESTINATION bin)
