! The code is written for the current PETSc (3.23 and later); this maps it back to PETSc 3.18. Include it after PETSc's own headers.
#include <petsc/finclude/petscsys.h>
#if PETSC_VERSION_LT(3, 22, 0)
#define VecGetArray VecGetArrayF90
#define VecRestoreArray VecRestoreArrayF90
#define VecGetArrayRead VecGetArrayReadF90
#define VecRestoreArrayRead VecRestoreArrayReadF90
#endif
