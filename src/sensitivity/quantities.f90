!> What is differentiated of a point, and its weights: the gradients by monitors, by contact forces lambda at the motion held, and by
!> the motion d at the forces held, all of them series of coefficients,
!>
!> $$ \delta Q = c \cdot \delta a + l \cdot \delta\lambda + k \cdot \delta d $$
!>
!> Half the range, the mean, or the cosine's or sine's coefficient of the first harmonic of a monitor a; sums over contacts of their
!> work against friction a period and of mean forces,
!>
!> $$ W = \oint T \, du = \pi \sum_h h (T_{ch} u_{sh} - T_{sh} u_{ch}) $$
module attrito_sensitivity_quantities
  use attrito_core_kinds, only: wp, pi
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_sensitivity_amplitude_gradient, only: amplitude_gradient
  use attrito_sensitivity_spring_forces, only: spring_forces
  implicit none
  private
  public :: quantity_type, weights_type, weights_of, total_forces
  public :: quantity_amplitude, quantity_mean, quantity_dissipated_energy, quantity_t1_mean, quantity_t2_mean, quantity_n_mean, &
            quantity_first_cosine, quantity_first_sine

  integer, parameter :: quantity_amplitude = 0, quantity_mean = 1, quantity_dissipated_energy = 2, quantity_t1_mean = 3, &
                        quantity_t2_mean = 4, quantity_n_mean = 5, quantity_first_cosine = 6, quantity_first_sine = 7

  type :: quantity_type
    integer :: kind = quantity_amplitude
    !> Factors on monitors, or on all contacts: the sum that is meant
    real(wp), allocatable :: factors(:)
  end type quantity_type

  type :: weights_type
    !> c [2 H + 1, monitors]; l and k of this rank's rows [2 H + 1, rows]
    real(wp), allocatable :: monitors(:, :), forces(:, :), motion(:, :)
  end type weights_type

contains

  !> Of a quantity at the balance's last evaluation.
  function weights_of(quantity, balance) result(weights)
    !> What is differentiated
    type(quantity_type), intent(in) :: quantity
    !> Harmonic balance, evaluated at the point
    type(balance_type), intent(in) :: balance
    type(weights_type) :: weights
    real(wp), allocatable :: own(:, :), motion(:, :)
    integer :: i

    own = balance%monitors%motion_of(balance%response)
    motion = balance%recover(balance%response)
    weights = weights_type(0.0_wp*own, 0.0_wp*motion, 0.0_wp*motion)
    select case (quantity%kind)
     case (quantity_amplitude)
      do i = 1, size(own, 2)
        if (abs(quantity%factors(i)) > 0.0_wp) weights%monitors(:, i) = quantity%factors(i)*amplitude_gradient(own(:, i))
      end do
     case (quantity_mean)
      weights%monitors(1, :) = quantity%factors(:size(own, 2))
     case (quantity_first_cosine)
      weights%monitors(2, :) = quantity%factors(:size(own, 2))
     case (quantity_first_sine)
      weights%monitors(3, :) = quantity%factors(:size(own, 2))
     case (quantity_dissipated_energy)
      call weigh_work(quantity, balance, motion, weights)
     case default
      call weigh_means(quantity, balance, weights)
    end select
  end function weights_of

  !> Of work against friction.
  subroutine weigh_work(quantity, balance, motion, weights)
    !> What is differentiated
    type(quantity_type), intent(in) :: quantity
    !> Harmonic balance, evaluated at the point
    type(balance_type), intent(in) :: balance
    !> Relative displacements [2 H + 1, rows]
    real(wp), intent(in) :: motion(:, :)
    type(weights_type), intent(inout) :: weights
    real(wp), allocatable :: forces(:, :)
    integer :: i, h, row

    forces = total_forces(balance, motion)
    do i = 1, size(balance%law)
      associate (factor => quantity%factors(balance%first_contact - 1 + i), first => balance%law(i)%first_row)
        do row = first, first + balance%law(i)%tangents - 1
          do h = 1, size(motion, 1)/2
            weights%forces(2*h:2*h + 1, row) = factor*pi*h*[motion(2*h + 1, row), -motion(2*h, row)]
            weights%motion(2*h:2*h + 1, row) = factor*pi*h*[-forces(2*h + 1, row), forces(2*h, row)]
          end do
        end do
      end associate
    end do
  end subroutine weigh_work

  !> Of mean forces along one of the rows of contacts.
  subroutine weigh_means(quantity, balance, weights)
    !> What is differentiated
    type(quantity_type), intent(in) :: quantity
    !> Harmonic balance, evaluated at the point
    type(balance_type), intent(in) :: balance
    type(weights_type), intent(inout) :: weights
    integer :: i, row

    do i = 1, size(balance%law)
      associate (law => balance%law(i))
        row = law%tangents
        if (quantity%kind == quantity_t1_mean) row = 0
        if (quantity%kind == quantity_t2_mean) row = 1
        if (quantity%kind == quantity_t2_mean .and. law%tangents < 2) cycle
        weights%forces(1, law%first_row + row) = quantity%factors(balance%first_contact - 1 + i)
      end associate
    end do
  end subroutine weigh_means

  !> lambda of this rank's rows [2 H + 1, rows].
  function total_forces(balance, motion) result(forces)
    !> Harmonic balance, evaluated at the point
    type(balance_type), intent(in) :: balance
    !> Relative displacements [2 H + 1, rows]
    real(wp), intent(in) :: motion(:, :)
    real(wp) :: forces(size(motion, 1), size(motion, 2))
    integer :: i

    forces = spring_forces(balance, motion)
    do i = 1, size(balance%law)
      associate (first => balance%law(i)%first_row, last => balance%law(i)%first_row + balance%law(i)%tangents)
        forces(:, first:last) = forces(:, first:last) + balance%forces(i)%deviation(:size(motion, 1), :)
      end associate
    end do
  end function total_forces
end module attrito_sensitivity_quantities
