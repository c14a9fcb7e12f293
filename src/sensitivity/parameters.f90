!> What parameters change of a scene, and derivatives by it: a number for each of what contact laws are made of, factors on static
!> loads, the level, factors on the harmonic loads by their harmonic, and numbers of the structure's damping.
!>
!> Columns of a contact are the numbers of its law, k_t, k_n, mu, gap, N_p; then further numbers that its kind of law is made of;
!> then its sliders, which the contact only has where it holds them.
module attrito_sensitivity_parameters
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: by_parameters_type, recipe_type, law_numbers, by_tangential_stiffness, by_normal_stiffness, by_friction, by_gap, &
            by_preload

  !> Numbers of every law, in this order
  integer, parameter :: law_numbers = 5
  integer, parameter :: by_tangential_stiffness = 1, by_normal_stiffness = 2, by_friction = 3, by_gap = 4, by_preload = 5

  !> A number for each column of all contacts [columns, contacts], each factor on static loads, the level, each factor on the loads
  !> of a harmonic [highest loaded] and each number of damping (`attrito_sensitivity_damping_derivatives`)
  type :: by_parameters_type
    real(wp), allocatable :: laws(:, :), static_factors(:), harmonic_factors(:), damping(:)
    real(wp) :: level = 0.0_wp
  end type by_parameters_type

  !> What a contact's law is made of: its kind, from 0, and further numbers; few where the kind has none
  type :: recipe_type
    integer :: kind = 0
    real(wp), allocatable :: numbers(:)
  end type recipe_type
end module attrito_sensitivity_parameters
