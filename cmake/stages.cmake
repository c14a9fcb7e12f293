# attrito_stage(name FOLDER folder AFTER stages LIBRARIES libraries): one target for src/<folder>, src/<name> unless it is given, so that the
#   compiler keeps the rules of the house.
#   A stage finds the modules only of the stages that it comes after.
#   Only the .F90 files, thin shells, are shown the modules of the libraries; a .f90 file, numerics, that uses one does not compile.

set(attrito_flags_all -std=f2018 -fimplicit-none -ffree-line-length-none -Wall -Wextra
    -Wno-unused-dummy-argument -Wno-maybe-uninitialized -Wno-compare-reals -Wno-uninitialized)
set(attrito_flags_Debug -O1 -g -fcheck=all,no-array-temps -fbacktrace -ffpe-trap=invalid,zero,overflow)
set(attrito_flags_Release -O3 -g1 -fexternal-blas)
# Sanitizers and coverage themselves are among CMake's own flags, which the linker is given too.
set(attrito_flags_Sanitize "")
set(attrito_flags_Coverage "")

set(attrito_includes_mpi ${MPI_Fortran_INCLUDE_DIRS})
set(attrito_includes_hdf5 ${HDF5_Fortran_INCLUDE_DIRS})
set(attrito_includes_fftw ${FFTW_INCLUDEDIR})
set(attrito_includes_petsc ${PETSC_INCLUDE_DIRS})
set(attrito_includes_slepc ${SLEPC_INCLUDE_DIRS})
set(attrito_includes_mumps ${MUMPS_INCLUDE})

set_property(GLOBAL PROPERTY attrito_stages "")

function(attrito_stage name)
  cmake_parse_arguments(stage "" "FOLDER" "AFTER;LIBRARIES" ${ARGN})
  if(NOT stage_FOLDER)
    set(stage_FOLDER ${name})
  endif()
  set(seen "")
  foreach(earlier ${stage_AFTER})
    get_property(theirs GLOBAL PROPERTY attrito_seen_${earlier})
    list(APPEND seen ${earlier} ${theirs})
  endforeach()
  list(REMOVE_DUPLICATES seen)
  set_property(GLOBAL PROPERTY attrito_seen_${name} ${seen})
  set_property(GLOBAL APPEND PROPERTY attrito_stages ${name})

  file(GLOB numerics CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/src/${stage_FOLDER}/*.f90)
  file(GLOB shells CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/src/${stage_FOLDER}/*.F90)
  add_library(attrito_${name} STATIC ${numerics} ${shells})
  set(modules ${CMAKE_BINARY_DIR}/modules/${name})
  set_target_properties(attrito_${name} PROPERTIES Fortran_MODULE_DIRECTORY ${modules})
  target_include_directories(attrito_${name} PRIVATE ${modules} ${CMAKE_SOURCE_DIR}/src/core)
  target_compile_options(attrito_${name} PRIVATE ${attrito_flags_all} ${attrito_flags_${CMAKE_BUILD_TYPE}})
  set(seen_targets "")
  foreach(earlier ${seen})
    list(APPEND seen_targets attrito_${earlier})
    target_include_directories(attrito_${name} PRIVATE ${CMAKE_BINARY_DIR}/modules/${earlier})
  endforeach()
  # Linked, not only ordered: so a stage is rebuilt when a module of an earlier one changes.
  target_link_libraries(attrito_${name} PRIVATE ${seen_targets})
  set(includes "")
  foreach(library ${stage_LIBRARIES})
    list(APPEND includes ${attrito_includes_${library}})
  endforeach()
  # As options, since CMake drops /usr/include, where gfortran does not look by itself.
  list(TRANSFORM includes PREPEND -I)
  set_source_files_properties(${shells} PROPERTIES COMPILE_OPTIONS "${includes}")
endfunction()

# attrito_shared_library(name): the stages, linked. MUMPS with SCOTCH comes before PETSc, whose own MUMPS is built without it on Debian.
function(attrito_shared_library name)
  get_property(stages GLOBAL PROPERTY attrito_stages)
  set(objects "")
  foreach(stage ${stages})
    list(APPEND objects $<TARGET_OBJECTS:attrito_${stage}>)
  endforeach()
  add_library(${name} SHARED ${objects})
  set_target_properties(${name} PROPERTIES LINKER_LANGUAGE Fortran VERSION ${PROJECT_VERSION})
  # What allocates in vain says so (src/core/exhausted.f90).
  target_link_options(${name} PRIVATE LINKER:--wrap=malloc,--wrap=calloc,--wrap=realloc)
  if(MUMPS_SCOTCH AND MUMPS_SCOTCH_COMMON)
    target_link_libraries(${name} PUBLIC -Wl,--no-as-needed ${MUMPS_SCOTCH} ${MUMPS_SCOTCH_COMMON} -Wl,--as-needed)
  endif()
  target_link_libraries(${name} PUBLIC ${MUMPS_COMPLEX} PkgConfig::SLEPC PkgConfig::PETSC PkgConfig::FFTW ${attrito_blas} hdf5::hdf5_fortran
    MPI::MPI_Fortran)
endfunction()

# attrito_use_stages(target): compiled as the library is, with every stage's modules in sight, and linked to it: suites, benchmarks.
function(attrito_use_stages target)
  set(includes ${attrito_includes_mpi})
  list(TRANSFORM includes PREPEND -I)
  target_compile_options(${target} PRIVATE ${attrito_flags_all} ${attrito_flags_${CMAKE_BUILD_TYPE}} ${includes})
  get_property(stages GLOBAL PROPERTY attrito_stages)
  foreach(stage ${stages})
    target_include_directories(${target} PRIVATE ${CMAKE_BINARY_DIR}/modules/${stage})
  endforeach()
  target_link_libraries(${target} PRIVATE attrito)
  # Its modules are not those of targets linked here, so the scan for module dependencies does not see them change.
  get_target_property(sources ${target} SOURCES)
  set_source_files_properties(${sources} PROPERTIES OBJECT_DEPENDS ${CMAKE_BINARY_DIR}/libattrito.so)
endfunction()
