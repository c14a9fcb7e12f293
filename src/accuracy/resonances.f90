!> Harmonics beyond a series whose frequencies meet a natural frequency, and that contact forces may move by more than is accepted.
!>
!> $$ x_r(h) \le \frac{\sum_i |b_{ri}| \, a_i / h^2}{|k_r - (h \omega)^2 m_r| + h \omega c_r}, \qquad
!>    a_i = \max_{K/2 < h \le K} h^2 |g_{h,i}| $$
!>
!> Forces of contacts that slip or open fade like 1/h^2 at least, so their last known harmonics bound those beyond. The natural
!> frequencies that count are those with the contacts as they are. They lie between that of the structure without contacts and that
!> with all of them stuck: where h omega lies between both, the denominator is that of resonance, h omega c_r.
module attrito_accuracy_resonances
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: symmetric_eigenpairs
  use attrito_core_trigonometric, only: to_complex
  use attrito_contact_state, only: state_slipping
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: resonances_type

  !> Harmonics that are looked at
  integer, parameter :: highest_looked_at = 60 ! conventional
  !> Coordinates up to which the structure without contacts is diagonalised; beyond, the stuck system's frequencies alone count
  integer, parameter :: largest_open_system = 600 ! conventional
  !> Damping ratio of modes that have none: it keeps their resonances finite
  real(wp), parameter :: nominal_ratio = 1.0e-3_wp ! guess
  !> Room about an interval of natural frequencies, part of them
  real(wp), parameter :: margin = 0.02_wp ! guess

  type :: resonances_type
    !> Natural angular frequencies of the structure without contacts, ascending [n]
    real(wp), allocatable, private :: open(:)
  contains
    procedure :: highest
  end type resonances_type

contains

  !> The highest harmonic that may matter, or `known` if none beyond does.
  integer function highest(self, solver, known, threshold)
    class(resonances_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> The last harmonic that is looked at anyway
    integer, intent(in) :: known
    !> Part of the contacts' motion, or of a monitor's, that may be missing
    real(wp), intent(in) :: threshold
    real(wp), allocatable :: directions(:, :), monitors(:, :), forces(:, :), coupling(:)
    real(wp) :: swing, motion, along, limits(size(solver%structure%monitors, 2)), rate
    integer :: r, h, first, last

    highest = known
    ! Not known for a sector, whose harmonics have natural frequencies of their own.
    if (allocated(solver%structure%sector)) return
    if (solver%stuck%omega(size(solver%stuck%omega)) < known*solver%omega) return
    if (.not. allocated(self%open)) call diagonalise(solver, self%open)
    associate (balance => solver%context%balance, stuck => solver%stuck)
      call in_modes(solver, directions, monitors)
      allocate (forces(size(directions, 1), 1))
      forces(:, 1) = matmul(abs(directions), bounds_of_forces(solver))
      coupling = sum(directions**2, 2)
      call balance%ranks%sum(forces)
      call balance%ranks%sum(coupling)
      limits = threshold*sqrt(sum(abs(balance%monitors%harmonics_of(1, balance%response(:, 1:)))**2, 2))
      swing = threshold*balance%norm(solver%motion(2:, :))
      do r = 1, size(stuck%omega)
        call span(self, r, stuck%omega(r), first, last)
        do h = min(last, highest_looked_at), max(first, highest + 1), -1
          rate = h*solver%omega*max(stuck%modal_damping(r), 2.0_wp*nominal_ratio*sqrt(stuck%modal_stiffness(r)*stuck%modal_mass(r)))
          motion = forces(r, 1)/h**2/rate
          along = motion*sqrt(coupling(r))
          if (along <= swing .and. all(motion*abs(monitors(r, :)) <= limits)) cycle
          highest = h
          exit
        end do
      end do
    end associate

  contains

    !> Harmonics in the interval of a natural frequency.
    pure subroutine span(self, r, stuck_omega, first, last)
      class(resonances_type), intent(in) :: self
      !> Number of the mode
      integer, intent(in) :: r
      !> Angular frequency of the stuck mode
      real(wp), intent(in) :: stuck_omega
      !> First of the harmonics; last of the harmonics
      integer, intent(out) :: first, last
      real(wp) :: low

      low = stuck_omega
      if (size(self%open) > 0) low = min(self%open(r), low)
      first = ceiling(min((1.0_wp - margin)*low/solver%omega, real(highest_looked_at + 1, wp)))
      last = floor(min((1.0_wp + margin)*stuck_omega/solver%omega, real(highest_looked_at, wp)))
    end subroutine span
  end function highest

  !> Natural frequencies of the structure without contacts; none where that is large.
  subroutine diagonalise(solver, omega)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Angular frequency, rad/s
    real(wp), allocatable, intent(out) :: omega(:)
    real(wp), allocatable :: squares(:), modes(:, :)
    integer :: info

    allocate (omega(0))
    if (size(solver%structure%mass, 1) > largest_open_system) return
    call symmetric_eigenpairs(solver%structure%stiffness, solver%structure%mass, squares, modes, info)
    if (info == 0) omega = sqrt(max(squares, 0.0_wp))
  end subroutine diagonalise

  !> Contacts' rows [n, rows of this rank] and monitors [n, monitors] in the coordinates of the stuck modes.
  subroutine in_modes(solver, directions, monitors)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Contacts' rows in modal coordinates; monitors in modal coordinates
    real(wp), allocatable, intent(out) :: directions(:, :), monitors(:, :)

    integer :: row

    associate (balance => solver%context%balance, stuck => solver%stuck)
      directions = balance%receptance%mode_shapes(1, size(stuck%omega), &
                                                  [(row, row=balance%first_row, balance%first_row + balance%rows() - 1)])
      monitors = matmul(transpose(stuck%modes), solver%structure%monitors)
    end associate
  end subroutine in_modes

  !> What h^2 |g_h| is at most for every row of this rank, by the harmonics of the forces that the balance has kept [rows].
  function bounds_of_forces(solver) result(bounds)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    real(wp) :: bounds(solver%context%balance%rows())
    integer :: i

    bounds = 0.0_wp
    associate (balance => solver%context%balance)
      do i = 1, size(balance%law)
        if (balance%forces(i)%state < state_slipping) cycle
        associate (first => balance%law(i)%first_row, last => balance%law(i)%first_row + balance%law(i)%tangents)
          bounds(first:last) = fading(balance%forces(i)%deviation)
        end associate
      end do
    end associate
  end function bounds_of_forces

  !> Largest h^2 |g_h| of every row over the upper half of the harmonics [rows].
  pure function fading(deviation) result(bound)
    !> Deviation of contact forces from those of their springs
    real(wp), intent(in) :: deviation(:, :)
    real(wp) :: bound(size(deviation, 2))
    complex(wp) :: columns(size(deviation, 2), 0:(size(deviation, 1) - 1)/2)
    integer :: h

    columns = to_complex(deviation)
    bound = 0.0_wp
    do h = ubound(columns, 2)/2 + 1, ubound(columns, 2)
      bound = max(bound, h**2*abs(columns(:, h)))
    end do
  end function fading
end module attrito_accuracy_resonances
