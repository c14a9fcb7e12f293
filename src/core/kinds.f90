!> The floating-point kinds, and the constants of the field.
module attrito_core_kinds
  use, intrinsic :: iso_fortran_env, only: real32, real64
  implicit none
  private
  public :: wp, sp, pi, two_pi

  !> Working precision: that of PETSc's real build
  integer, parameter :: wp = real64
  !> Single precision: for what makes a solve faster and no result
  integer, parameter :: sp = real32
  real(wp), parameter :: pi = acos(-1.0_wp) ! derived
  real(wp), parameter :: two_pi = 2.0_wp * pi ! derived
end module attrito_core_kinds
