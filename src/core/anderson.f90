!> Fixed points x = G(x) by Anderson's method: the next x is the mixture of the last answers whose residuals f = G(x) - x cancel best,
!>
!> $$ x_{n+1} = G(x_n) - \sum_j \gamma_j \, (G(x_{j+1}) - G(x_j)), \qquad
!>    \gamma = \arg\min \Big| f_n - \sum_j \gamma_j (f_{j+1} - f_j) \Big| $$
!>
!> If G is linear that is GMRES. Answers need not converge by themselves.
!> Source: Walker & Ni 2011, doi:10.1137/10078356X.
module attrito_core_anderson
  use attrito_core_communicator, only: communicator_type
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: solve_dense
  implicit none
  private
  public :: anderson_type

  !> Bytes of changes that a rank keeps, and the fewest changes that it keeps however long they are: the oldest give way
  real(wp), parameter :: most_bytes = 1.6e8_wp ! conventional
  integer, parameter :: fewest = 8 ! guess

  type :: anderson_type
    !> Changes of residuals and of answers from one x to the next, this rank's part [size of either, answers - 1]
    real(wp), allocatable, private :: residuals(:, :), answers(:, :)
    !> How many of them are kept at most
    integer, private :: most = 0
    !> The last of both
    real(wp), allocatable, private :: residual(:), answer(:)
  contains
    procedure :: next
  end type anderson_type

contains

  !> The next x, or whatever follows linearly from the answers.
  function next(self, ranks, residual, answer)
    class(anderson_type), intent(inout) :: self
    !> That share x
    type(communicator_type), intent(in) :: ranks
    !> G(x) - x, this rank's part
    real(wp), intent(in) :: residual(:)
    !> G(x), and what else is to be mixed as it is
    real(wp), intent(in) :: answer(:)
    real(wp) :: next(size(answer))
    !> Part of a square of changes of residuals that is added to it, so that changes which are all alike have an answer
    real(wp), parameter :: rounding = 1.0e-12_wp ! derived
    real(wp), allocatable :: products(:, :), right(:, :)
    integer :: i, n, first, status

    next = answer
    if (allocated(self%residual)) then
      n = min(size(self%residuals, 2) + 1, self%most)
      first = size(self%residuals, 2) + 2 - n
      self%residuals = reshape([self%residuals(:, first:), residual - self%residual], [size(residual), n])
      self%answers = reshape([self%answers(:, first:), answer - self%answer], [size(answer), n])
      products = matmul(transpose(self%residuals), self%residuals)
      right = matmul(transpose(self%residuals), reshape(residual, [size(residual), 1]))
      call ranks%sum(products)
      call ranks%sum(right)
      do i = 1, n
        products(i, i) = products(i, i)*(1.0_wp + rounding) + tiny(1.0_wp)
      end do
      call solve_dense(products, right, status)
      if (status == 0) next = answer - matmul(self%answers, right(:, 1))
    else
      allocate (self%residuals(size(residual), 0), self%answers(size(answer), 0))
      self%most = max(fewest, int(most_bytes/(8*ranks%largest(real(size(residual) + size(answer) + 1, wp)))))
    end if
    self%residual = residual
    self%answer = answer
  end function next
end module attrito_core_anderson
