!> Rows of the model's displacements, those of B or of monitors, in generalised coordinates: one column of P_h each,
!>
!> $$ d_h = P_h^H x_h, \qquad f_h = P_h \lambda_h, \qquad P_h = (B_h \Phi_h)^H, \qquad h = 0 \ldots H $$
!>
!> with displacements q_h = Phi_h x_h. A structure by itself has one real P for all harmonics, and one product serves them all. A
!> sector of a cyclic structure has a complex P for each nodal diameter. These repeat after so many harmonics, the second half of them
!> are conjugates of the first, and that of the mean is real.
module attrito_linear_projected_rows
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: product_with_few
  use attrito_core_trigonometric, only: to_complex, to_real
  use attrito_model_sector, only: first_alike, is_mirrored
  implicit none
  private
  public :: projected_rows_type, new_projected_rows, new_projected_rows_by_harmonic

  !> Numbers of P from which on products take half the time with P on the left: BLAS copies what is on the right in smaller pieces
  integer, parameter :: large = 100000 ! measured

  type :: projected_rows_type
    private
    !> P, where it is the same for all harmonics [n, rows]
    real(wp), allocatable :: common(:, :)
    !> P_h, where harmonics differ [n, rows, 0:period/2], and after how many harmonics they repeat
    complex(wp), allocatable :: by_harmonic(:, :, :)
    integer :: period = 1
  contains
    procedure :: number
    procedure :: load_of
    procedure :: mean_load_of
    procedure :: motion_of
    procedure :: motion_from
    procedure :: mean_of
    procedure :: row_of
    procedure :: row_at
    procedure :: harmonics_of
    procedure :: chosen_harmonics_of
    procedure :: moduli
    procedure :: part
    procedure, private :: columns_of
    procedure, private :: column_of
  end type projected_rows_type

contains

  !> The same for all harmonics.
  pure function new_projected_rows(columns) result(self)
    !> P [n, rows]
    real(wp), intent(in) :: columns(:, :)
    type(projected_rows_type) :: self

    self%common = columns
  end function new_projected_rows

  !> One P for each harmonic, which repeat.
  pure function new_projected_rows_by_harmonic(columns, period) result(self)
    !> P_h, the first real [n, rows, 0:period/2]
    complex(wp), intent(in) :: columns(:, :, 0:)
    !> Harmonics after which they repeat; P_{period - h} is the conjugate of P_h
    integer, intent(in) :: period
    type(projected_rows_type) :: self

    self%period = period
    allocate (self%by_harmonic(size(columns, 1), size(columns, 2), 0:size(columns, 3) - 1), source=columns)
  end function new_projected_rows_by_harmonic

  !> How many rows.
  pure integer function number(self)
    class(projected_rows_type), intent(in) :: self

    if (allocated(self%by_harmonic)) then
      number = size(self%by_harmonic, 2)
    else
      number = size(self%common, 2)
    end if
  end function number

  !> Loads f = P lambda on the generalised coordinates [2 H + 1, n]. Rows without a force, often most of them, are left out.
  pure function load_of(self, forces) result(load)
    class(projected_rows_type), intent(in) :: self
    !> Forces along the rows, lambda [2 H + 1, rows]
    real(wp), intent(in) :: forces(:, :)
    real(wp), allocatable :: load(:, :)
    complex(wp), allocatable :: columns(:, :), loads(:, :)
    integer, allocatable :: loaded(:)
    integer :: h, row

    if (.not. allocated(self%by_harmonic)) then
      loaded = pack([(row, row=1, size(forces, 2))], [(any(abs(forces(:, row)) > 0.0_wp), row=1, size(forces, 2))])
      if (2*size(loaded) < size(forces, 2)) then
        load = load_of_few(forces(:, loaded), self%common(:, loaded))
      else
        load = load_of_few(forces, self%common)
      end if
      return
    end if
    columns = to_complex(forces)
    allocate (loads(size(self%by_harmonic, 1), size(columns, 2)))
    do h = 0, size(columns, 2) - 1
      loads(:, h + 1) = matmul(self%columns_of(h), columns(:, h + 1))
    end do
    load = to_real(loads)
  end function load_of

  !> Mean loads of mean forces [n].
  pure function mean_load_of(self, forces) result(load)
    class(projected_rows_type), intent(in) :: self
    !> Mean forces along the rows [rows]
    real(wp), intent(in) :: forces(:)
    real(wp), allocatable :: load(:)

    if (allocated(self%by_harmonic)) then
      load = matmul(real(self%by_harmonic(:, :, 0), wp), forces)
    else
      load = matmul(self%common, forces)
    end if
  end function mean_load_of

  !> Displacements along the rows, d = P^H x [2 H + 1, rows].
  pure function motion_of(self, response) result(motion)
    class(projected_rows_type), intent(in) :: self
    !> Coordinates of the response, by harmonic [n, 0:H]
    complex(wp), intent(in) :: response(:, 0:)
    real(wp), allocatable :: motion(:, :)

    if (allocated(self%by_harmonic)) then
      motion = to_real(self%harmonics_of(0, response))
    else
      motion = motion_of_few(to_real(response), self%common)
    end if
  end function motion_of

  !> The same of the harmonics from one on, without a mean [2 harmonics, rows].
  pure function motion_from(self, first, response) result(motion)
    class(projected_rows_type), intent(in) :: self
    !> First of the harmonics, from 1
    integer, intent(in) :: first
    !> Coordinates of the response at these harmonics [n, harmonics]
    complex(wp), intent(in) :: response(:, :)
    real(wp), allocatable :: motion(:, :)
    complex(wp), allocatable :: columns(:, :)
    real(wp) :: parts(2*size(response, 2), size(response, 1))
    integer :: i

    if (allocated(self%by_harmonic)) then
      columns = self%harmonics_of(first, response)
      allocate (motion(2*size(columns, 2), size(columns, 1)))
      do i = 1, size(columns, 2)
        motion(2*i - 1, :) = real(columns(:, i), wp)
        motion(2*i, :) = -aimag(columns(:, i))
      end do
      return
    end if
    do i = 1, size(response, 2)
      parts(2*i - 1, :) = real(response(:, i), wp)
      parts(2*i, :) = -aimag(response(:, i))
    end do
    motion = motion_of_few(parts, self%common)
  end function motion_from

  !> lambda P^T, lambda having few rows.
  pure function load_of_few(forces, columns) result(load)
    !> lambda [few, rows]
    real(wp), intent(in) :: forces(:, :)
    !> P [n, rows]
    real(wp), intent(in) :: columns(:, :)
    real(wp) :: load(size(forces, 1), size(columns, 1))

    if (size(columns) > large) then
      load = transpose(matmul(columns, transpose(forces)))
    else
      load = matmul(forces, transpose(columns))
    end if
  end function load_of_few

  !> x P, x having few rows.
  pure function motion_of_few(response, columns) result(motion)
    !> x [few, n]
    real(wp), intent(in) :: response(:, :)
    !> P [n, rows]
    real(wp), intent(in) :: columns(:, :)
    real(wp) :: motion(size(response, 1), size(columns, 2))

    if (size(columns) > large) then
      motion = transpose(matmul(transpose(columns), transpose(response)))
    else
      motion = matmul(response, columns)
    end if
  end function motion_of_few

  !> Mean displacements along the rows [rows].
  pure function mean_of(self, mean) result(motion)
    class(projected_rows_type), intent(in) :: self
    !> Mean of the coordinates [n]
    complex(wp), intent(in) :: mean(:)
    real(wp), allocatable :: motion(:)

    if (allocated(self%by_harmonic)) then
      motion = matmul(real(mean, wp), real(self%by_harmonic(:, :, 0), wp))
    else
      motion = matmul(real(mean, wp), self%common)
    end if
  end function mean_of

  !> Displacement along one row [2 H + 1].
  pure function row_of(self, row, response) result(motion)
    class(projected_rows_type), intent(in) :: self
    !> Number of the row
    integer, intent(in) :: row
    !> Coordinates of the response, by harmonic [n, 0:H]
    complex(wp), intent(in) :: response(:, 0:)
    real(wp), allocatable :: motion(:)
    type(projected_rows_type) :: alone

    if (allocated(self%by_harmonic)) then
      alone = self%part([row])
      motion = reshape(alone%motion_of(response), [2*ubound(response, 2) + 1])
    else
      motion = matmul(to_real(response), self%common(:, row))
    end if
  end function row_of

  !> Displacement along one row at one harmonic.
  pure complex(wp) function row_at(self, row, h, response) result(motion)
    class(projected_rows_type), intent(in) :: self
    !> Number of the row; number of the harmonic
    integer, intent(in) :: row, h
    !> x_h [n]
    complex(wp), intent(in) :: response(:)

    if (allocated(self%by_harmonic)) then
      motion = dot_product(self%column_of(row, h), response)
    else
      motion = sum(self%common(:, row)*response)
    end if
  end function row_at

  !> Displacements along the rows at some harmonics, one after the other [rows, harmonics].
  pure function harmonics_of(self, first, response) result(motion)
    class(projected_rows_type), intent(in) :: self
    !> First of the harmonics
    integer, intent(in) :: first
    !> Coordinates of the response at these harmonics [n, harmonics]
    complex(wp), intent(in) :: response(:, :)
    complex(wp), allocatable :: motion(:, :)
    integer :: i

    if (.not. allocated(self%by_harmonic)) then
      motion = matmul(transpose(self%common), response)
      return
    end if
    allocate (motion(self%number(), size(response, 2)))
    do i = 1, size(response, 2)
      motion(:, i) = matmul(conjg(transpose(self%columns_of(first - 1 + i))), response(:, i))
    end do
  end function harmonics_of

  !> Displacements along the rows at chosen harmonics, cosine before sine [rows, 2 chosen].
  function chosen_harmonics_of(self, chosen, response) result(motion)
    class(projected_rows_type), intent(in) :: self
    !> Numbers of the harmonics
    integer, intent(in) :: chosen(:)
    !> Coordinates of the response, by harmonic [n, 0:H]
    complex(wp), intent(in) :: response(:, 0:)
    real(wp), allocatable :: motion(:, :)
    real(wp) :: parts(size(response, 1), 2*size(chosen))
    complex(wp), allocatable :: one(:, :)
    integer :: i

    if (allocated(self%by_harmonic)) then
      allocate (motion(self%number(), 2*size(chosen)))
      do i = 1, size(chosen)
        one = self%harmonics_of(chosen(i), response(:, chosen(i):chosen(i)))
        motion(:, 2*i - 1) = real(one(:, 1), wp)
        motion(:, 2*i) = -aimag(one(:, 1))
      end do
      return
    end if
    do i = 1, size(chosen)
      parts(:, 2*i - 1) = real(response(:, chosen(i)), wp)
      parts(:, 2*i) = -aimag(response(:, chosen(i)))
    end do
    motion = product_with_few(self%common, parts)
  end function chosen_harmonics_of

  !> |P_h| [n, rows].
  pure function moduli(self, h)
    class(projected_rows_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    real(wp), allocatable :: moduli(:, :)

    if (allocated(self%by_harmonic)) then
      moduli = abs(self%by_harmonic(:, :, first_alike(h, self%period)))
    else
      moduli = abs(self%common)
    end if
  end function moduli

  !> Some of the rows.
  pure function part(self, rows) result(chosen)
    class(projected_rows_type), intent(in) :: self
    !> Their numbers
    integer, intent(in) :: rows(:)
    type(projected_rows_type) :: chosen

    if (allocated(self%by_harmonic)) then
      chosen = new_projected_rows_by_harmonic(self%by_harmonic(:, rows, :), self%period)
    else
      chosen = new_projected_rows(self%common(:, rows))
    end if
  end function part

  !> P_h, where harmonics differ [n, rows].
  pure function columns_of(self, h) result(columns)
    class(projected_rows_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    complex(wp) :: columns(size(self%by_harmonic, 1), size(self%by_harmonic, 2))

    columns = self%by_harmonic(:, :, first_alike(h, self%period))
    if (is_mirrored(h, self%period)) columns = conjg(columns)
  end function columns_of

  !> One of them [n].
  pure function column_of(self, row, h) result(column)
    class(projected_rows_type), intent(in) :: self
    !> Number of the row; number of the harmonic
    integer, intent(in) :: row, h
    complex(wp) :: column(size(self%by_harmonic, 1))

    column = self%by_harmonic(:, row, first_alike(h, self%period))
    if (is_mirrored(h, self%period)) column = conjg(column)
  end function column_of
end module attrito_linear_projected_rows
