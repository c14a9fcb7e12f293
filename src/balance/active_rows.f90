!> The contacts of this rank that slip or open, side by side: what a Newton step has to be solved for.
!>
!> Fields on their rows are [2 H + 1, rows]. The receptance between them, R_AA, is applied through the generalised coordinates: what
!> crosses ranks is one block of generalised harmonics.
module attrito_balance_active_rows
  use attrito_core_kinds, only: wp
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_balance_receptance, only: to_complex, to_real
  implicit none
  private
  public :: active_rows_type, new_active_rows

  type :: active_rows_type
    !> Their places among this rank's contacts; their first rows here and among this rank's rows; how many rows each has
    integer, allocatable :: contacts(:), first(:), source(:), rows(:)
    !> Rows of all of them
    integer :: count = 0
    !> Rows of B in generalised coordinates, in columns [n, count]
    real(wp), allocatable :: directions(:, :)
  contains
    procedure :: gather
    procedure :: scatter
    procedure :: rows_of_all
    procedure :: receive
    procedure :: multiply_jacobian
  end type active_rows_type

contains

  !> Those whose forces, at the balance's last evaluation, depend on the motion.
  function new_active_rows(balance) result(self)
    type(balance_type), intent(in) :: balance
    type(active_rows_type) :: self
    integer :: i

    self%contacts = pack([(i, i=1, size(balance%law))], [(any(balance%forces(i)%active), i=1, size(balance%law))])
    self%rows = balance%law(self%contacts)%tangents + 1
    self%source = balance%law(self%contacts)%first_row
    self%first = [(1 + sum(self%rows(:i - 1)), i=1, size(self%rows))]
    self%count = sum(self%rows)
    allocate (self%directions(size(balance%directions, 1), self%count))
    do i = 1, size(self%contacts)
      self%directions(:, self%first(i):self%first(i) + self%rows(i) - 1) = &
        balance%directions(:, self%source(i):self%source(i) + self%rows(i) - 1)
    end do
  end function new_active_rows

  !> Their part of a field on all rows of this rank.
  pure function gather(self, field) result(part)
    class(active_rows_type), intent(in) :: self
    real(wp), intent(in) :: field(:, :)
    real(wp) :: part(size(field, 1), self%count)
    integer :: i

    do i = 1, size(self%contacts)
      part(:, self%first(i):self%first(i) + self%rows(i) - 1) = field(:, self%source(i):self%source(i) + self%rows(i) - 1)
    end do
  end function gather

  !> A field on all rows of this rank, zero outside them.
  pure subroutine scatter(self, part, field)
    class(active_rows_type), intent(in) :: self
    real(wp), intent(in) :: part(:, :)
    real(wp), intent(out) :: field(:, :)
    integer :: i

    field = 0.0_wp
    do i = 1, size(self%contacts)
      field(:, self%source(i):self%source(i) + self%rows(i) - 1) = part(:, self%first(i):self%first(i) + self%rows(i) - 1)
    end do
  end subroutine scatter

  !> Their rows, by their place among those of all ranks.
  pure function rows_of_all(self, balance) result(rows)
    class(active_rows_type), intent(in) :: self
    type(balance_type), intent(in) :: balance
    integer :: rows(self%count)
    integer :: i, row

    rows = [((balance%first_row - 1 + self%source(i) + row, row=0, self%rows(i) - 1), i=1, size(self%rows))]
  end function rows_of_all

  !> R_AA y: what the rows receive from forces y on them, of all ranks; by the split receptance where that is in use.
  function receive(self, balance, y) result(motion)
    class(active_rows_type), intent(in) :: self
    type(balance_type), intent(in) :: balance
    real(wp), intent(in), contiguous :: y(:, :)
    real(wp) :: motion(size(y, 1), size(y, 2))
    real(wp) :: generalised(size(y, 1), size(self%directions, 1))
    complex(wp) :: response(size(self%directions, 1), 0:balance%receptance%harmonics)

    if (balance%split%in_use) then
      motion = balance%split%receive(balance%ranks, y)
      if (allocated(balance%frozen_mean)) motion(1, :) = 0.0_wp
      return
    end if
    generalised = matmul(y, transpose(self%directions))
    call balance%ranks%sum(generalised)
    call balance%receptance%respond(to_complex(generalised), response)
    if (allocated(balance%frozen_mean)) response(:, 0) = 0.0_wp
    motion = matmul(to_real(response), self%directions)
  end function receive

  !> D d, contact by contact, D being what the balance holds.
  function multiply_jacobian(self, balance, motion) result(product)
    class(active_rows_type), intent(in) :: self
    type(balance_type), intent(in) :: balance
    real(wp), intent(in), contiguous :: motion(:, :)
    real(wp) :: product(size(motion, 1), size(motion, 2))
    integer :: i

    do i = 1, size(self%contacts)
      associate (first => self%first(i), last => self%first(i) + self%rows(i) - 1)
        product(:, first:last) = (1.0_wp - balance%stiffening)*reshape( &
                                 matmul(balance%forces(self%contacts(i))%jacobian, &
                                        reshape(motion(:, first:last), [size(motion, 1)*self%rows(i)])), &
                                 [size(motion, 1), self%rows(i)])
      end associate
    end do
  end function multiply_jacobian
end module attrito_balance_active_rows
