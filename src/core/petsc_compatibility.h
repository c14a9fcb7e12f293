! The code is written for the current PETSc (3.23 and later); this maps it back to PETSc 3.18. Include it after PETSc's own headers.
!
! Array access: the current release has lost the suffix F90. Null arrays: it has named them. How to factor: it has made a type of it.
! Contexts of shells: it declares what takes and gives them; for 3.18 those who use them declare it themselves.
#include <petsc/finclude/petscsys.h>
#if PETSC_VERSION_LT(3, 22, 0)
#define VecGetArray VecGetArrayF90
#define VecRestoreArray VecRestoreArrayF90
#define VecGetArrayRead VecGetArrayReadF90
#define VecRestoreArrayRead VecRestoreArrayReadF90
#define MatDenseGetArray MatDenseGetArrayF90
#define MatDenseRestoreArray MatDenseRestoreArrayF90
#define ISGetIndices ISGetIndicesF90
#define ISRestoreIndices ISRestoreIndicesF90
#define PETSC_NULL_INTEGER_ARRAY PETSC_NULL_INTEGER
#define PETSC_NULL_SCALAR_ARRAY PETSC_NULL_SCALAR
#define PETSC_NULL_REAL_ARRAY PETSC_NULL_REAL
#define PETSC_CURRENT_INTEGER PETSC_DEFAULT_INTEGER
#define PETSC_CURRENT_REAL PETSC_DEFAULT_REAL
#define PETSC_DETERMINE_INTEGER PETSC_DEFAULT_INTEGER
#define FACTOR_INFO(name) MatFactorInfo :: name(MAT_FACTORINFO_SIZE)
#else
#define FACTOR_INFO(name) MatFactorInfo :: name
#endif
