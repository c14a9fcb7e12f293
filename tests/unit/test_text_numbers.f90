!> Numbers out of text: rounded as they should be, wherever a line puts them.
program test_text_numbers
  use, intrinsic :: iso_fortran_env, only: int32, int64
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_text_numbers, only: read_columns, read_entries, read_number, read_separated
  use testing, only: test, run_suite, check, check_close
  implicit none

  if (run_suite('text_numbers', [ &
                test('numbers of every form are what they spell', forms), &
                test('what spells no number is not taken for one', no_numbers), &
                test('halfway cases round to the even neighbour, others to the nearer one', halfway), &
                test('numbers of any length read as the compiler reads them', random_numbers), &
                test('fields may be separated by blanks, commas or both, and be empty', separated_fields), &
                test('lines of whole numbers and a value read as separated fields do', entries), &
                test('a line that holds anything else than whole numbers and a value is not read as one', no_entries), &
                test('fields at fixed places may touch, and be empty', fixed_fields)], quiet=.false.) > 0) error stop 1

contains

  !> `read_separated` is the plain twin.
  subroutine entries(error)
    type(error_type), allocatable, intent(out) :: error
    character(40), parameter :: lines(5) = [character(40) :: '1 2 3.5', '  12,  7,-1.25E-03', '999999999 , 1 , 0', &
                                            '3'//achar(9)//'4 1.2345678901234567e-11'//achar(13), '5,6,7 ']
    character :: text(200)
    integer(int64) :: first(5), last(5)
    integer(int32) :: whole(5, 2)
    real(wp) :: values(5), table(3, 5)
    integer :: k, bad

    text = letters(lines(1)//lines(2)//lines(3)//lines(4)//lines(5))
    first = [(1_int64 + 40*k, k=0, 4)]
    last = first + len_trim(lines) - 1
    call read_separated(text, first, last, table, bad)
    call check(error, bad == 0, 'the plain twin does not read them: the test is void')
    call read_entries(text, first, last, whole, values, bad)
    call check(error, bad == 0, 'they are not read')
    call check_close(error, real(transpose(whole), wp), table(:2, :), 0.0_wp, 'whole numbers')
    call check_close(error, values, table(3, :), 0.0_wp, 'values')
  end subroutine entries

  subroutine no_entries(error)
    type(error_type), allocatable, intent(out) :: error
    character(24), parameter :: lines(12) = [character(24) :: '', '1 2', '1,,3.0', '0 2 1.0', '-1 2 1.0', '1.0 2 3.0', '1e1 2 3.0', &
                                             '1 2 3.0 4', '1 2 3.0,', '1 2 x', '1234567890 2 3.0', '1 2 1e999']
    integer(int32) :: whole(1, 2)
    real(wp) :: values(1)
    integer :: k, bad

    do k = 1, size(lines)
      call read_entries(letters(lines(k)), [1_int64], [len_trim(lines(k), int64)], whole, values, bad)
      call check(error, bad == 1, lines(k)//'is read')
    end do
  end subroutine no_entries

  !> The number that a text spells; not found: `found` is false.
  function spelled(text, found) result(number)
    character(*), intent(in) :: text
    logical, intent(out) :: found
    real(wp) :: number

    number = 0.0_wp
    call read_number(letters(text), 1_int64, len(text, int64), number, found)
  end function spelled

  pure function letters(text)
    character(*), intent(in) :: text
    character :: letters(len(text))
    integer :: k

    letters = [(text(k:k), k=1, len(text))]
  end function letters

  subroutine expect(error, text, number)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: text
    real(wp), intent(in) :: number
    real(wp) :: got
    logical :: found

    got = spelled(text, found)
    call check(error, found, text//' is a number')
    call check_close(error, got, number, 0.0_wp, text)
  end subroutine expect

  subroutine forms(error)
    type(error_type), allocatable, intent(out) :: error

    call expect(error, '12', 12.0_wp)
    call expect(error, '-0.5', -0.5_wp)
    call expect(error, '+.25', 0.25_wp)
    call expect(error, '3.', 3.0_wp)
    call expect(error, '1.5e3', 1500.0_wp)
    call expect(error, '1.5E+03', 1500.0_wp)
    call expect(error, '-1.5d-3', -1.5e-3_wp)
    call expect(error, '2.5+10', 2.5e10_wp)
    call expect(error, '3.-5', 3.0e-5_wp)
    call expect(error, '0.0', 0.0_wp)
    call expect(error, '1.0e36', 1.0e36_wp)
    call expect(error, '1e-300', 1.0e-300_wp)
    call expect(error, '000000000000000000000000000001.5', 1.5_wp)
  end subroutine forms

  subroutine no_numbers(error)
    type(error_type), allocatable, intent(out) :: error
    character(8), parameter :: texts(11) = [character(8) :: 'x', '.', '-', '1.2.3', '1e', '1e+', '1x', 'nan', 'inf', '1-2-3', '1 2']
    real(wp) :: number
    logical :: found
    integer :: k

    do k = 1, size(texts)
      number = spelled(trim(texts(k)), found)
      call check(error, .not. found, trim(texts(k))//' is no number')
    end do
  end subroutine no_numbers

  !> 2^53 + 1 lies between two doubles, and so does 2^53 + 3.
  subroutine halfway(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: base = 2.0_wp**53

    call expect(error, '9007199254740993', base)
    call expect(error, '9007199254740995', base + 4.0_wp)
    call expect(error, '9007199254740993.1', base + 2.0_wp)
    call expect(error, '900719925474099.3e1', base)
    call expect(error, '9007199254740993.00000000000000000000001', base + 2.0_wp)
    call expect(error, '9007199254740992.99999999999999999999999', base)
    call expect(error, '1.00000000000000011102230246251565', 1.0_wp)
    call expect(error, '1.00000000000000011102230246251566', 1.0_wp + epsilon(1.0_wp))
  end subroutine halfway

  subroutine random_numbers(error)
    type(error_type), allocatable, intent(out) :: error
    character(9), parameter :: formats(4) = ['(es32.13)', '(es32.15)', '(es32.16)', '(es32.19)']
    real(wp) :: random(2), number, expected
    character(32) :: text
    integer :: i, k

    do i = 1, 20000
      call random_number(random)
      number = (random(1) - 0.5_wp)*10.0_wp**int(80.0_wp*random(2) - 40.0_wp)
      do k = 1, size(formats)
        write (text, formats(k)) number
        read (text, *) expected
        call expect(error, trim(adjustl(text)), expected)
      end do
    end do
  end subroutine random_numbers

  subroutine separated_fields(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: lines = ' 1, 2 ,3'//'4 5'//'6,,7'//' '//'1 2 3 4'//'1,x,3'
    integer(int64), parameter :: first(6) = [1, 9, 12, 16, 17, 24], last(6) = [8, 11, 15, 16, 23, 28]
    real(wp) :: table(3, 4), one(3, 1)
    integer :: bad

    call read_separated(letters(lines), first(:4), last(:4), table, bad)
    call check(error, bad == 0, 'four lines of at most three fields')
    call check_close(error, table(:, 1), [1.0_wp, 2.0_wp, 3.0_wp], 0.0_wp, 'commas and blanks')
    call check_close(error, table(:2, 2), [4.0_wp, 5.0_wp], 0.0_wp, 'blanks')
    call check(error, table(3, 2) /= table(3, 2) .and. table(2, 3) /= table(2, 3), 'fields left empty')
    call check_close(error, table([1, 3], 3), [6.0_wp, 7.0_wp], 0.0_wp, 'an empty field between commas')
    call check(error, all(table(:, 4) /= table(:, 4)), 'a blank line')
    call read_separated(letters(lines), first(5:5), last(5:5), one, bad)
    call check(error, bad == 1, 'a field too many')
    call read_separated(letters(lines), first(6:6), last(6:6), one, bad)
    call check(error, bad == 1, 'a field that is no number')
  end subroutine separated_fields

  subroutine fixed_fields(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: lines = '*   12-1.5D+2'//'*        7.'//'*   1x'
    integer(int64), parameter :: first(3) = [1, 14, 25], last(3) = [13, 24, 30]
    integer, parameter :: begin(3) = [2, 6, 20], width(3) = [4, 7, 8]
    real(wp) :: table(3, 2), one(3, 1)
    integer :: bad

    call read_columns(letters(lines), first(:2), last(:2), begin, width, table, bad)
    call check(error, bad == 0, 'two lines')
    call check_close(error, table(:2, 1), [12.0_wp, -150.0_wp], 0.0_wp, 'fields that touch')
    call check_close(error, table(2, 2), 7.0_wp, 0.0_wp, 'a number that the end of its line cuts short')
    call check(error, table(1, 2) /= table(1, 2) .and. all(table(3, :) /= table(3, :)), 'empty fields')
    call read_columns(letters(lines), first(3:), last(3:), begin, width, one, bad)
    call check(error, bad == 1, 'a field that is no number')
  end subroutine fixed_fields
end program test_text_numbers
