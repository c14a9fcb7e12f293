!> Receptance in real coordinates that are the same for all harmonics, as a structure by itself has them:
!>
!> $$ q_h = \Phi x_h, \qquad F_h = \Phi^T f_h, \qquad d_h = B \Phi x_h $$
!>
!> Loads, rows and displacements of all harmonics are turned by one product.
module attrito_linear_receptance_real
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: to_complex, to_real
  use attrito_linear_projected_rows, only: projected_rows_type, new_projected_rows
  use attrito_linear_receptance, only: receptance_type
  implicit none
  private
  public :: receptance_real_type

  type, abstract, extends(receptance_type) :: receptance_real_type
    !> Phi [m, n]
    real(wp), allocatable :: basis(:, :)
    !> Rows of B in generalised coordinates, in columns [n, rows]
    real(wp), allocatable :: directions(:, :)
  contains
    procedure :: project_load
    procedure :: project_loads
    procedure :: project_mean_loads
    procedure :: project_rows
    procedure :: contact_rows
    procedure :: recover
    procedure :: displacements
    procedure :: state_at_start
    procedure :: common_modes
    procedure :: solve_adjoint
  end type receptance_real_type

contains

  function project_load(self, h, load) result(projected)
    class(receptance_real_type), intent(in) :: self
    !> Number of the harmonic: they are alike
    integer, intent(in) :: h
    !> f_h [m]
    complex(wp), intent(in) :: load(:)
    complex(wp), allocatable :: projected(:)

    projected = cmplx(matmul(transpose(self%basis), real(load, wp)), matmul(transpose(self%basis), aimag(load)), wp)
  end function project_load

  function project_loads(self, loads) result(projected)
    class(receptance_real_type), intent(in) :: self
    !> Fourier coefficients of the model's coordinates [m, 2 H + 1]
    real(wp), intent(in) :: loads(:, :)
    complex(wp), allocatable :: projected(:, :)

    allocate (projected(size(self%basis, 2), 0:(size(loads, 2) - 1)/2))
    projected = to_complex(matmul(transpose(loads), self%basis))
  end function project_loads

  function project_mean_loads(self, loads) result(projected)
    class(receptance_real_type), intent(in) :: self
    !> On the model's coordinates [m, loads]
    real(wp), intent(in) :: loads(:, :)
    real(wp), allocatable :: projected(:, :)

    projected = matmul(transpose(self%basis), loads)
  end function project_mean_loads

  function project_rows(self, rows) result(projected)
    class(receptance_real_type), intent(in) :: self
    !> In columns [m, rows]
    real(wp), intent(in) :: rows(:, :)
    type(projected_rows_type) :: projected

    projected = new_projected_rows(matmul(transpose(self%basis), rows))
  end function project_rows

  function contact_rows(self, first, last) result(projected)
    class(receptance_real_type), intent(in) :: self
    !> The first and the last, from 1
    integer, intent(in) :: first, last
    type(projected_rows_type) :: projected

    projected = new_projected_rows(self%directions(:, first:last))
  end function contact_rows

  function recover(self, h, response) result(displacement)
    class(receptance_real_type), intent(in) :: self
    !> Number of the harmonic: they are alike
    integer, intent(in) :: h
    !> x_h [n]
    complex(wp), intent(in) :: response(:)
    complex(wp), allocatable :: displacement(:)

    displacement = matmul(self%basis, response)
  end function recover

  function displacements(self, response) result(coefficients)
    class(receptance_real_type), intent(in) :: self
    !> Coordinates of the response, by harmonic [n, 0:H]
    complex(wp), intent(in) :: response(:, 0:)
    real(wp), allocatable :: coefficients(:, :)

    coefficients = matmul(to_real(response), transpose(self%basis))
  end function displacements

  subroutine state_at_start(self, response, omega, displacement, rate)
    class(receptance_real_type), intent(in) :: self
    !> Coordinates of the response, by harmonic [n, 0:H]
    complex(wp), intent(in) :: response(:, 0:)
    !> Angular frequency
    real(wp), intent(in) :: omega
    !> Of the model's coordinates [m]
    real(wp), allocatable, intent(out) :: displacement(:), rate(:)
    integer :: h

    displacement = real(response(:, 0), wp)
    rate = 0.0_wp*displacement
    do h = 1, ubound(response, 2)
      displacement = displacement + real(response(:, h), wp)
      rate = rate - h*omega*aimag(response(:, h))
    end do
    displacement = matmul(self%basis, displacement)
    rate = matmul(self%basis, rate)
  end subroutine state_at_start

  pure integer function common_modes(self)
    class(receptance_real_type), intent(in) :: self

    common_modes = size(self%basis, 2)
  end function common_modes

  !> Z_h^-H b = conj(Z_h^-1 conj(b)): real matrices make Z_h complex symmetric.
  subroutine solve_adjoint(self, h, columns)
    class(receptance_real_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> Right-hand sides [n, k], then solutions
    complex(wp), intent(inout), contiguous :: columns(:, :)

    columns = conjg(columns)
    call self%solve(h, columns)
    columns = conjg(columns)
  end subroutine solve_adjoint
end module attrito_linear_receptance_real
