!> F(s) of Hill's problem (`attrito_stability_hill_problem`) times a vector, without the matrix: what contacts that slip or open make
!> of their motion is a product of periodic functions, and what a resting slider holds is one number, so a thousand harmonics are
!> cheap.
!>
!> $$ (F g)_k = g_k + \sum_j G_{k - j} (R g)_j + \sum_{\text{rests}} h_k \sum_j e^{i j \tau} (R g)_j $$
module attrito_stability_hill_operator
  use attrito_core_convolution, only: convolution_type, new_convolution
  use attrito_core_kinds, only: wp
  use attrito_stability_hill_problem, only: hill_problem_type, force_held
  implicit none
  private
  public :: hill_operator_type, new_hill_operator

  type :: hill_operator_type
    type(convolution_type), private :: convolution
    !> Transforms of what slip and lift-off make of u and v [length, forces, 2]
    complex(wp), allocatable, private :: slip_and_open(:, :, :)
    !> R(s), of u and of v of all forces [2 K + 1, forces, 2 forces]
    complex(wp), allocatable, private :: response(:, :, :)
    !> Of each rest: harmonics of its force, and the factors e^{i j tau} of the motion where it begins [2 K + 1, rests]
    complex(wp), allocatable, private :: held(:, :), turn(:, :)
  contains
    procedure :: set_exponent
    procedure :: multiply
    procedure :: destroy
  end type hill_operator_type

contains

  !> What does not depend on s.
  subroutine new_hill_operator(problem, self)
    !> Hill's problem
    class(hill_problem_type), intent(in) :: problem
    type(hill_operator_type), intent(out) :: self
    integer :: i, j, k

    self%convolution = new_convolution(problem%harmonics)
    allocate (self%slip_and_open(self%convolution%length, size(problem%row), 2))
    do j = 1, 2
      do i = 1, size(problem%row)
        self%slip_and_open(:, i, j) = self%convolution%transform(problem%slip_and_open(:, i, j))
      end do
    end do
    allocate (self%turn(2*problem%harmonics + 1, size(problem%rests)), self%held(2*problem%harmonics + 1, size(problem%rests)))
    do i = 1, size(problem%rests)
      self%turn(:, i) = [(exp(cmplx(0.0_wp, k*problem%rests(i)%origin, wp)), k=-problem%harmonics, problem%harmonics)]
    end do
  end subroutine new_hill_operator

  !> Be F(s) from now on.
  subroutine set_exponent(self, problem, s)
    class(hill_operator_type), intent(inout) :: self
    !> Hill's problem
    class(hill_problem_type), intent(in) :: problem
    !> Exponent over the angular frequency of the excitation
    complex(wp), intent(in) :: s
    integer :: i

    self%response = problem%responses(s, [problem%row_u, problem%row_v])
    do i = 1, size(problem%rests)
      self%held(:, i) = force_held(problem, s, problem%rests(i))
    end do
  end subroutine set_exponent

  !> F(s) g.
  function multiply(self, problem, g) result(product)
    class(hill_operator_type), intent(in) :: self
    !> Hill's problem
    class(hill_problem_type), intent(in) :: problem
    !> Harmonics of the forces, force by force
    complex(wp), intent(in) :: g(:)
    complex(wp) :: product(size(g))
    complex(wp) :: forces(2*problem%harmonics + 1, size(problem%row)), u(size(forces, 1), size(forces, 2)), v(size(u, 1), size(u, 2))
    integer :: i

    forces = reshape(g, shape(forces))
    do i = 1, size(forces, 2)
      u(:, i) = sum(self%response(:, :, i)*forces, 2)
      v(:, i) = sum(self%response(:, :, size(forces, 2) + i)*forces, 2)
    end do
    associate (convolution => self%convolution)
      do i = 1, size(forces, 2)
        forces(:, i) = forces(:, i) + convolution%transform_back(convolution%transform(u(:, i))*self%slip_and_open(:, i, 1) &
                                                                 + convolution%transform(v(:, i))*self%slip_and_open(:, i, 2))
      end do
    end associate
    do i = 1, size(problem%rests)
      associate (rest => problem%rests(i))
        forces(:, rest%force) = forces(:, rest%force) &
                                + self%held(:, i)*sum(self%turn(:, i)*(u(:, rest%force) + rest%by_normal*v(:, rest%force)))
      end associate
    end do
    product = reshape(forces, shape(product))
  end function multiply

  !> Give back what is not Fortran's own.
  subroutine destroy(self)
    class(hill_operator_type), intent(inout) :: self

    call self%convolution%destroy()
  end subroutine destroy
end module attrito_stability_hill_operator
