!> Harmonics beyond a series whose frequencies meet a natural frequency, and that contact forces may move by more than is accepted.
!>
!> $$ x_r(h) \le \frac{\sum_i |b_{ri}| \, a_i / h^2}{|k_r - (h \omega)^2 m_r| + h \omega c_r}, \qquad
!>    a_i = \max_{K/2 < h \le K} h^2 |g_{h,i}| $$
!>
!> Forces of contacts that slip or open fade like 1/h^2 at least, so their last known harmonics bound those beyond. The natural
!> frequencies that count are those with the contacts as they are. They lie between that of the structure without contacts and that
!> with all of them stuck: where h omega lies between both, the denominator is that of resonance, h omega c_r.
!>
!> Of a sector of a wheel each harmonic meets the modes of its own nodal diameter, b being complex. Where damping couples these, they
!> are not looked at.
module attrito_accuracy_resonances
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: symmetric_eigenpairs
  use attrito_core_lapack_complex, only: hermitian_eigenpairs
  use attrito_core_trigonometric, only: to_complex
  use attrito_contact_state, only: state_slipping
  use attrito_linear_stuck_system, only: stuck_system_type
  use attrito_model_sector, only: first_alike
  use attrito_model_structure, only: structure_type
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

  !> Natural angular frequencies without contacts, ascending [n]; none where that structure is large
  type :: frequencies_type
    real(wp), allocatable :: omega(:)
  end type frequencies_type

  !> Modes with every contact stuck: angular frequencies, stiffness, mass, damping [n]; moduli at this rank's contact rows [n, rows]
  !> and at monitors [n, monitors]
  type :: modes_type
    real(wp), allocatable :: omega(:), stiffness(:), mass(:), damping(:), rows(:, :), monitors(:, :)
  end type modes_type

  type :: resonances_type
    !> Of the structure, or of a sector at the nodal diameters of harmonics 0 ... half a period
    type(frequencies_type), allocatable, private :: open(:)
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
    real(wp) :: bounds(solver%context%balance%rows()), limits(size(solver%structure%monitors, 2)), swing
    integer :: alike

    highest = known
    if (allocated(solver%structure%sector) .and. .not. solver%stuck%uncoupled) return
    if (highest_natural(solver%stuck) < known*solver%omega) return
    if (.not. allocated(self%open)) call diagonalise(solver, self%open)
    associate (balance => solver%context%balance)
      bounds = bounds_of_forces(solver)
      limits = threshold*sqrt(sum(abs(balance%monitors%harmonics_of(1, balance%response(:, 1:)))**2, 2))
      swing = threshold*balance%norm(solver%motion(2:, :))
      do alike = 0, ubound(self%open, 1)
        call look(solver, modes_of(solver, alike), self%open(alike)%omega, alike, bounds, limits, swing, highest)
      end do
    end associate
  end function highest

  !> The highest natural angular frequency with every contact stuck.
  pure real(wp) function highest_natural(stuck) result(omega)
    !> Linear system with every contact stuck
    type(stuck_system_type), intent(in) :: stuck
    integer :: h

    omega = maxval([(maxval(stuck%omega_at(h)), h=0, stuck%period/2)])
  end function highest_natural

  !> Among the harmonics that have some modes.
  subroutine look(solver, modes, open, alike, bounds, limits, swing, highest)
    !> Solver of points: its angular frequency
    type(solver_type), intent(in) :: solver
    !> Modes with every contact stuck
    type(modes_type), intent(in) :: modes
    !> Angular frequencies without contacts [n] or [0]
    real(wp), intent(in) :: open(:)
    !> Of these harmonics, the first
    integer, intent(in) :: alike
    !> What h^2 |g_h| is at most for every row of this rank [rows]
    real(wp), intent(in) :: bounds(:)
    !> Motion of each monitor, and of all contacts, that may be missing
    real(wp), intent(in) :: limits(:), swing
    !> The highest harmonic that may matter so far
    integer, intent(inout) :: highest
    real(wp) :: forces(size(modes%omega), 1), coupling(size(modes%omega)), motion, rate
    integer :: r, h, first, last

    if (modes%omega(size(modes%omega)) < highest*solver%omega) return
    forces(:, 1) = matmul(modes%rows, bounds)
    coupling = sum(modes%rows**2, 2)
    associate (ranks => solver%context%balance%ranks)
      call ranks%sum(forces)
      call ranks%sum(coupling)
    end associate
    do r = 1, size(modes%omega)
      call span(open, r, modes%omega(r), solver%omega, first, last)
      do h = min(last, highest_looked_at), max(first, highest + 1), -1
        if (first_alike(h, solver%stuck%period) /= alike) cycle
        rate = h*solver%omega*max(modes%damping(r), 2.0_wp*nominal_ratio*sqrt(modes%stiffness(r)*modes%mass(r)))
        motion = forces(r, 1)/h**2/rate
        if (motion*sqrt(coupling(r)) <= swing .and. all(motion*modes%monitors(r, :) <= limits)) cycle
        highest = h
        exit
      end do
    end do
  end subroutine look

  !> Harmonics in the interval of a natural frequency.
  pure subroutine span(open, r, stuck, omega, first, last)
    !> Angular frequencies without contacts [n] or [0]
    real(wp), intent(in) :: open(:)
    !> Number of the mode
    integer, intent(in) :: r
    !> Its angular frequency with every contact stuck; that of the excitation
    real(wp), intent(in) :: stuck, omega
    !> First of the harmonics; last of the harmonics
    integer, intent(out) :: first, last
    real(wp) :: low

    low = stuck
    if (size(open) > 0) low = min(open(r), low)
    first = ceiling(min((1.0_wp - margin)*low/omega, real(highest_looked_at + 1, wp)))
    last = floor(min((1.0_wp + margin)*stuck/omega, real(highest_looked_at, wp)))
  end subroutine span

  !> Natural frequencies of the structure without contacts; none where that is large.
  subroutine diagonalise(solver, open)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> See `resonances_type`
    type(frequencies_type), allocatable, intent(out) :: open(:)
    real(wp), allocatable :: squares(:), modes(:, :)
    integer :: h, info

    allocate (open(0:solver%stuck%period/2))
    do h = 0, ubound(open, 1)
      allocate (open(h)%omega(0))
      if (size(solver%structure%mass, 1) > largest_open_system) cycle
      associate (structure => solver%structure)
        if (allocated(structure%sector)) then
          call diagonalise_wave(structure, structure%sector%diameter(h), squares, info)
        else
          call symmetric_eigenpairs(structure%stiffness, structure%mass, squares, modes, info)
        end if
      end associate
      if (info == 0) open(h)%omega = sqrt(max(squares, 0.0_wp))
    end do
  end subroutine diagonalise

  !> Squares of a sector's natural frequencies without contacts, of the coordinates that move at a nodal diameter.
  subroutine diagonalise_wave(structure, diameter, squares, info)
    !> The sector: mass, stiffness, damping
    type(structure_type), intent(in) :: structure
    !> n
    integer, intent(in) :: diameter
    !> Ascending
    real(wp), allocatable, intent(out) :: squares(:)
    !> 0, or not: mass is not positive definite
    integer, intent(out) :: info
    complex(wp), allocatable :: stiffness(:, :), mass(:, :), waves(:, :)

    associate (moving => structure%sector%moving(diameter))
      stiffness = structure%sector%couple(structure%stiffness, diameter)
      mass = structure%sector%couple(structure%mass, diameter)
      call hermitian_eigenpairs(stiffness(moving, moving), mass(moving, moving), squares, waves, info)
    end associate
  end subroutine diagonalise_wave

  !> Modes of a harmonic and of those like it.
  function modes_of(solver, h) result(modes)
    !> Solver of points: its balance and stuck system
    type(solver_type), intent(in) :: solver
    !> Number of the harmonic, from 0
    integer, intent(in) :: h
    type(modes_type) :: modes
    real(wp), allocatable :: directions(:, :), rows(:, :), monitors(:, :)
    integer :: row

    associate (balance => solver%context%balance, stuck => solver%stuck)
      if (allocated(stuck%diameters)) then
        rows = balance%contact_rows%moduli(h)
        monitors = balance%monitors%moduli(h)
        modes%omega = stuck%omega_at(h)
        call stuck%modal_at(h, modes%stiffness, modes%mass, modes%damping)
        modes%rows = rows(:size(modes%omega), :)
        modes%monitors = monitors(:size(modes%omega), :)
      else
        directions = balance%receptance%mode_shapes(1, size(stuck%omega), [(row, row=balance%first_row, &
                                                                            balance%first_row + balance%rows() - 1)])
        modes = modes_type(stuck%omega, stuck%modal_stiffness, stuck%modal_mass, stuck%modal_damping, abs(directions), &
                           abs(matmul(transpose(stuck%modes), solver%structure%monitors)))
      end if
    end associate
  end function modes_of

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
