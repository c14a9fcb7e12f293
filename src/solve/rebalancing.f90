!> Contacts shared out over ranks by the work they are, not by their number: a stuck contact costs next to nothing.
!>
!> Ranks keep contiguous runs of contacts, cut where the work of all that come before is an even part of the total; they are cut again
!> when that would relieve the busiest rank. The work is counted from states, so it is the same on every run.
module attrito_solve_rebalancing
  use attrito_core_kinds, only: wp
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_state, only: state_shaken_down
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: rebalance, field_type

  !> How much lighter the busiest rank must become
  real(wp), parameter :: least_relief = 1.2_wp ! guess
  !> Work of a contact that stays stuck, one that rests after its slider moved, and one that slips or opens
  integer, parameter :: work_stuck = 1, work_resting = 10, work_moving = 100 ! guess

  !> Something that moves with the contacts
  type :: field_type
    !> A column for each row of this rank's contacts, or for each contact
    real(wp), allocatable :: columns(:, :)
    logical :: by_contact = .false.
  end type field_type

contains

  !> Share out again after the last point if it pays; fields follow.
  subroutine rebalance(solver, fields)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Fields that move with the contacts
    type(field_type), intent(inout) :: fields(:)
    integer, allocatable :: work(:), owner(:)
    integer :: i

    associate (balance => solver%context%balance)
      if (balance%ranks%ranks == 1) return
      call balance%ranks%gather_integers([(work_of(balance%forces(i)), i=1, size(balance%forces))], work)
      call balance%ranks%gather_integers(spread(balance%ranks%rank, 1, size(balance%forces)), owner)
      if (busiest(work, even_shares(work, balance%ranks%ranks), balance%ranks%ranks)*least_relief &
          > busiest(work, owner, balance%ranks%ranks)) return
    end associate
    call move(solver, even_shares(work, solver%context%balance%ranks%ranks), fields)
  end subroutine rebalance

  pure integer function work_of(forces)
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(in) :: forces

    work_of = work_stuck
    if (.not. allocated(forces%jacobian)) return
    work_of = merge(work_resting, work_moving, forces%state == state_shaken_down)
  end function work_of

  !> The rank of each contact, from 0, that evens out the work.
  pure function even_shares(work, ranks) result(owner)
    !> Work of each contact; number of ranks
    integer, intent(in) :: work(:), ranks
    integer :: owner(size(work))
    integer :: i, before

    before = 0
    do i = 1, size(work)
      owner(i) = min(int(ranks*(before + 0.5_wp*work(i))/sum(work)), ranks - 1)
      before = before + work(i)
    end do
  end function even_shares

  !> Work of the busiest rank.
  pure real(wp) function busiest(work, owner, ranks)
    !> Work of each contact; rank of each contact, from 0; number of ranks
    integer, intent(in) :: work(:), owner(:), ranks
    integer :: rank

    busiest = maxval([(real(sum(work, owner == rank), wp), rank=0, ranks - 1)])
  end function busiest

  !> Take over the contacts that are this rank's now, with all that belongs to them.
  subroutine move(solver, owner, fields)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Rank of each contact, from 0
    integer, intent(in) :: owner(:)
    !> Fields that move with the contacts
    type(field_type), intent(inout) :: fields(:)
    type(field_type) :: own(5)
    integer :: first, last, i

    associate (balance => solver%context%balance)
      own(1) = field_type(solver%motion)
      own(2) = field_type(solver%static_slider, .true.)
      own(3) = field_type(balance%slider, .true.)
      own(4) = field_type(reshape(merge(1.0_wp, 0.0_wp, balance%periodic), [1, size(balance%periodic)]), .true.)
      own(5) = field_type(solver%static_motion)
      first = count(owner < balance%ranks%rank) + 1
      last = count(owner <= balance%ranks%rank)
      do i = 1, size(own)
        call hand_over(solver, first, last, own(i))
      end do
      do i = 1, size(fields)
        if (allocated(fields(i)%columns)) call hand_over(solver, first, last, fields(i))
      end do
      call solver%hold_contacts(first, last)
      solver%motion = own(1)%columns
      solver%static_slider = own(2)%columns
      balance%slider = own(3)%columns
      balance%periodic = own(4)%columns(1, :) > 0.5_wp
      solver%static_motion = own(5)%columns
    end associate
  end subroutine move

  !> All columns of a field, and of them those of the contacts first ... last.
  subroutine hand_over(solver, first, last, field)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> First of the contacts; last of the contacts
    integer, intent(in) :: first, last
    !> Fields that move with the contacts
    type(field_type), intent(inout) :: field
    real(wp), allocatable :: everyone(:, :)
    integer :: from, to

    associate (contacts => solver%contacts)
      allocate (everyone(size(field%columns, 1), merge(size(contacts%law), size(contacts%directions, 2), field%by_contact)))
    end associate
    call solver%context%balance%ranks%gather_columns_everywhere(field%columns, everyone)
    from = first
    to = last
    if (.not. field%by_contact) then
      from = 1 + sum(solver%contacts%law(:first - 1)%tangents + 1)
      to = sum(solver%contacts%law(:last)%tangents + 1)
    end if
    field%columns = everyone(:, from:to)
  end subroutine hand_over
end module attrito_solve_rebalancing
