!> Where multipliers cross the unit circle on a step along a branch.
!>
!> Between two points of which a different number of multipliers lies outside, the one that is to cross next is followed,
!>
!> $$ \ln |\mu_j(s)| = 0, \qquad j = \min(n_a, n_b) + 1, \quad |\mu_1| \ge |\mu_2| \ge \dots, $$
!>
!> by secants and halvings. It crosses at -1 (flip), at 1 (a turning point, or two branches that meet), or as a pair
!> (Neimark-Sacker); or it jumps over the circle where a contact begins to do something else. Only multipliers of the motion count:
!> zeros of sliders that are forgotten and ones of those that stay are no crossings.
!> Source: Kuznetsov 2004, doi:10.1007/978-1-4757-3978-7; di Bernardo et al. 2008, doi:10.1007/978-1-84628-708-4.
module attrito_stability_crossing
  use attrito_core_kinds, only: wp
  use attrito_core_secant, only: bracket_type
  use attrito_core_state_store, only: state_store_type
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_step, only: step_type
  use attrito_integrate_system, only: system_type
  use attrito_stability_examine, only: examination_type, examine_options_type, examine, balanced_orbit, exact_orbit, &
                                        automatic_orbit
  use attrito_stability_examination, only: is_near
  use attrito_stability_multipliers, only: multiplier_type, kind_floquet
  implicit none
  private
  public :: crossing_type, locate_crossings, moduli_type, moduli_of, crossing_flip, crossing_unit, crossing_pair, crossing_jump

  integer, parameter :: crossing_flip = 1, crossing_unit = 2, crossing_pair = 3, crossing_jump = 4

  !> What is left open: of the frequency, relative to it; of ln|mu|; least part of the step
  real(wp), parameter :: accuracy = 1.0e-9_wp, on_circle = 1.0e-7_wp, least_part = 1.0e-6_wp ! derived
  !> Change of ln|mu| over what is left of the step that is a jump
  real(wp), parameter :: jump = 1.0e-3_wp ! guess
  !> Part of the motion by which two solutions that near each other may differ on one branch
  real(wp), parameter :: same_branch = 1.0e-2_wp ! guess
  integer, parameter :: most_tries = 40, most_crossings = 4 ! conventional

  !> The dynamic multipliers of a point, the largest first; the same on every rank
  type :: moduli_type
    complex(wp), allocatable :: value(:)
    !> Are they of the event-exact orbit?
    logical :: exact = .false.
  contains
    procedure :: keep
  end type moduli_type

  type :: crossing_type
    integer :: kind = crossing_jump
    !> Of the upper half plane
    complex(wp) :: multiplier = 0.0_wp
    type(snapshot_type) :: snapshot
    !> What is left of the step there, rad/s
    real(wp) :: uncertain = 0.0_wp
    !> Does the larger number lie outside beyond it?
    logical :: loses = .false.
  end type crossing_type

  !> One end of what is left of a step
  type :: end_type
    real(wp) :: part = 0.0_wp
    type(snapshot_type) :: snapshot
    type(moduli_type) :: moduli
  end type end_type

contains

  !> Save to a store, or load from it.
  subroutine keep(self, store)
    class(moduli_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call store%keep(self%value)
    call store%keep(self%exact)
  end subroutine keep

  !> What an examination found, sent to every rank; none if it found nothing.
  subroutine moduli_of(solver, examination, self)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> What is found of stability
    type(examination_type), intent(in) :: examination
    type(moduli_type), intent(out) :: self
    type(multiplier_type), allocatable :: found(:)
    real(wp), allocatable :: parts(:)
    real(wp) :: sent(2)

    if (allocated(examination%hill)) found = examination%hill
    if (allocated(examination%monodromy)) found = examination%monodromy
    if (.not. allocated(found)) allocate (found(0))
    self%value = pack(found%value, found%kind == kind_floquet)
    associate (ranks => solver%context%balance%team)
      sent = [real(size(self%value), wp), merge(1.0_wp, 0.0_wp, size(self%value) > 0 .and. is_near(examination))]
      call ranks%sum(sent)
      self%exact = nint(sent(2)) > 0
      allocate (parts(2*nint(sent(1))), source=0.0_wp)
      if (ranks%is_root()) parts = [real(self%value, wp), aimag(self%value)]
      call ranks%sum(parts)
    end associate
    associate (n => size(parts)/2)
      self%value = cmplx(parts(:n), parts(n + 1:), wp)
    end associate
  end subroutine moduli_of

  pure integer function outside(moduli)
    !> Dynamic multipliers of a point, the largest first
    type(moduli_type), intent(in) :: moduli

    outside = count(abs(moduli%value) > 1.0_wp)
  end function outside

  !> All crossings on a step, in their order. The solver is left where the search ends.
  subroutine locate_crossings(solver, system, options, step, moduli, found)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), allocatable, intent(in) :: system
    !> Engines, and the orbit that they examine
    type(examine_options_type), intent(in) :: options
    !> Step along the branch
    type(step_type), intent(in) :: step
    !> At both ends of the step
    type(moduli_type), intent(in) :: moduli(2)
    !> Crossings of the unit circle
    type(crossing_type), allocatable, intent(out) :: found(:)
    type(examine_options_type) :: one_orbit
    type(end_type) :: a, b, end
    logical :: on_branch
    integer :: try

    allocate (found(0))
    if (any([size(moduli(1)%value), size(moduli(2)%value)] == 0)) return
    a = end_type(0.0_wp, step%from, moduli(1))
    end = end_type(1.0_wp, step%to, moduli(2))
    if (outside(a%moduli) == outside(end%moduli)) return
    one_orbit = options
    call settle_on_orbit(solver, system, step, one_orbit, a, end)
    do try = 1, most_crossings
      if (outside(a%moduli) == outside(end%moduli)) return
      b = end
      call close_in(solver, system, one_orbit, step, a, b)
      on_branch = distance(solver, a%snapshot, b%snapshot) <= same_branch
      if (on_branch) found = [found, crossing_between(a, b)]
      a = b
    end do
  end subroutine locate_crossings

  !> Multipliers at both ends of one kind of orbit: where either may be meant, of the event-exact one if it is there at both.
  subroutine settle_on_orbit(solver, system, step, options, a, b)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), allocatable, intent(in) :: system
    !> Step along the branch
    type(step_type), intent(in) :: step
    !> Engines, and the orbit that they examine
    type(examine_options_type), intent(inout) :: options
    !> End of what is left of the step
    type(end_type), intent(inout) :: a, b
    type(end_type) :: ends(2)
    integer :: orbit, i
    logical :: solved(2)

    if (options%orbit /= automatic_orbit .or. (a%moduli%exact .and. b%moduli%exact)) then
      if (options%orbit == automatic_orbit) options%orbit = exact_orbit
      return
    end if
    do orbit = exact_orbit, balanced_orbit, balanced_orbit - exact_orbit
      options%orbit = orbit
      ends = [a, b]
      do i = 1, 2
        call examine_part(solver, system, options, step, ends(i), solved(i))
      end do
      if (all(solved) .and. (orbit == balanced_orbit .or. all(ends%moduli%exact))) exit
    end do
    a = ends(1)
    b = ends(2)
  end subroutine settle_on_orbit

  !> Bring two ends together on a crossing.
  subroutine close_in(solver, system, options, step, a, b)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), allocatable, intent(in) :: system
    !> Engines, and the orbit that they examine
    type(examine_options_type), intent(in) :: options
    !> Step along the branch
    type(step_type), intent(in) :: step
    !> End of what is left of the step
    type(end_type), intent(inout) :: a, b
    type(end_type) :: new
    type(bracket_type) :: bracket
    real(wp) :: value
    logical :: solved
    integer :: try, watched

    watched = min(outside(a%moduli), outside(b%moduli)) + 1
    bracket = bracket_type([a%part, b%part], [logarithm(a%moduli, watched), logarithm(b%moduli, watched)])
    do try = 1, most_tries
      new%part = bracket%trial(try)
      call examine_part(solver, system, options, step, new, solved)
      if (.not. solved) return
      value = logarithm(new%moduli, watched)
      if (value*bracket%weight(1) > 0.0_wp) then
        a = new
        call bracket%take(1, new%part, value)
      else
        b = new
        call bracket%take(2, new%part, value)
      end if
      if (abs(value) < on_circle .or. bracket%width() < least_part .or. &
          abs(b%snapshot%omega - a%snapshot%omega) < accuracy*a%snapshot%omega .and. abs(value) < jump) return
      watched = min(outside(a%moduli), outside(b%moduli)) + 1
    end do
  end subroutine close_in

  !> Multipliers at a part of the step.
  subroutine examine_part(solver, system, options, step, self, solved)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), allocatable, intent(in) :: system
    !> Engines, and the orbit that they examine
    type(examine_options_type), intent(in) :: options
    !> Step along the branch
    type(step_type), intent(in) :: step
    type(end_type), intent(inout) :: self
    !> Is the point solved?
    logical, intent(out) :: solved
    type(examination_type) :: examination

    call step%solve_part(solver, self%part, solved)
    if (.not. solved) return
    self%snapshot = snapshot_of(solver)
    call examine(solver, system, options, examination)
    call moduli_of(solver, examination, self%moduli)
    solved = size(self%moduli%value) > 0
  end subroutine examine_part

  !> ln|mu| of the multiplier that is watched; far below the circle if there is none.
  pure real(wp) function logarithm(moduli, watched)
    !> Dynamic multipliers of a point, the largest first
    type(moduli_type), intent(in) :: moduli
    !> Number of the multiplier
    integer, intent(in) :: watched

    logarithm = -1.0_wp
    if (watched <= size(moduli%value)) logarithm = log(max(abs(moduli%value(watched)), exp(-1.0_wp)))
  end function logarithm

  !> The crossing between two ends that are near each other.
  function crossing_between(a, b) result(self)
    !> End of what is left of the step
    type(end_type), intent(in) :: a, b
    type(crossing_type) :: self
    integer :: watched
    real(wp) :: before, after

    watched = min(outside(a%moduli), outside(b%moduli)) + 1
    before = logarithm(a%moduli, watched)
    after = logarithm(b%moduli, watched)
    self%loses = after > before
    self%uncertain = abs(b%snapshot%omega - a%snapshot%omega)
    associate (nearer => merge(1, 2, abs(before) < abs(after)))
      self%snapshot = a%snapshot
      self%multiplier = a%moduli%value(watched)
      if (nearer == 2) then
        self%snapshot = b%snapshot
        self%multiplier = b%moduli%value(watched)
      end if
    end associate
    self%multiplier = cmplx(real(self%multiplier, wp), abs(aimag(self%multiplier)), wp)
    self%kind = crossing_unit
    if (real(self%multiplier, wp) < 0.0_wp) self%kind = crossing_flip
    if (aimag(self%multiplier) > 0.0_wp) self%kind = crossing_pair
    if (min(abs(before), abs(after)) > jump) self%kind = crossing_jump
  end function crossing_between

  !> Of two motions, relative to the first.
  real(wp) function distance(solver, one, other)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Motion, sliders and frequency to return to
    type(snapshot_type), intent(in) :: one, other

    associate (balance => solver%context%balance)
      distance = balance%norm(other%motion(2:, :) - one%motion(2:, :))/max(balance%norm(one%motion(2:, :)), tiny(1.0_wp))
    end associate
  end function distance
end module attrito_stability_crossing
