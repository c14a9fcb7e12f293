!> Numbers out of lines of text, as many as matrix files of FE codes hold: each is rounded correctly.
!>
!> A number is [sign] digits [. digits] [exponent], the exponent e5, E+05, D-05, or a bare sign and digits (Nastran's 2.5+10).
!> Up to 15 digits m and |k| <= 22 make m 10^k exact factors, one rounding: Clinger, How to read floating point numbers
!> accurately (1990), doi:10.1145/93542.93557. Up to 18 digits and |k| <= 44 are computed to twice the digits of a double
!> (Dekker 1971, doi:10.1007/BF01397083); if what may be missing from those could change the rounding, and for all other
!> numbers, the C library's strtod reads them.
module attrito_core_text_numbers
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_loc, c_null_char, c_null_ptr, c_ptr
  use, intrinsic :: iso_fortran_env, only: int32, int64, real128
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_quiet_nan, ieee_value
  use, intrinsic :: ieee_exceptions, only: ieee_get_status, ieee_overflow, ieee_set_halting_mode, ieee_set_status, ieee_status_type
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: read_separated, read_columns, read_entries, read_number

  !> Longest number looked at; no program writes more
  integer, parameter :: longest = 64 ! conventional
  integer(int64), parameter :: fifteen_digits = 10_int64**15, eighteen_digits = 10_int64**18
  integer :: power
  !> 10^k, exact: 5^44 has 103 bits
  real(real128), parameter :: exact_powers(0:44) = [(10.0_real128**power, power=0, 44)] ! derived
  real(wp), parameter :: powers(0:44) = real(exact_powers, wp) ! derived
  real(wp), parameter :: rest_of_powers(0:44) = real(exact_powers - powers, wp) ! derived

  interface
    function strtod(text, rest) bind(c, name="strtod") result(number)
      import :: c_char, c_double, c_ptr
      !> Characters of the file
      character(kind=c_char), intent(in) :: text(*)
      type(c_ptr), value :: rest
      real(c_double) :: number
    end function strtod
  end interface

contains

  !> Fields of lines separated by blanks or single commas; what stands between two commas may be nothing.
  subroutine read_separated(text, first, last, table, bad)
    !> Characters of the file
    character, intent(in) :: text(*)
    !> [lines], where each line begins and ends in the text, from 1
    integer(int64), intent(in) :: first(:), last(:)
    !> [fields, lines]; NaN where a line has nothing
    real(wp), intent(out) :: table(:, :)
    !> First line with a field that is no finite number, or with too many; 0: none
    integer, intent(out) :: bad
    integer :: line, field
    integer(int64) :: position, start
    logical :: found

    bad = 0
    table = ieee_value(1.0_wp, ieee_quiet_nan)
    do line = 1, size(first)
      position = first(line)
      do field = 1, size(table, 1) + 1
        call skip_blanks(text, position, last(line))
        if (position > last(line)) exit
        found = field <= size(table, 1)
        if (found .and. text(position) /= ",") then
          start = position
          do while (position <= last(line))
            if (text(position) == "," .or. is_blank(text(position))) exit
            position = position + 1
          end do
          call read_number(text, start, position - 1, table(field, line), found)
        end if
        if (.not. found) then
          bad = line
          return
        end if
        call skip_blanks(text, position, last(line))
        if (position <= last(line)) then
          if (text(position) == ",") position = position + 1
        end if
      end do
    end do
  end subroutine read_separated

  !> Lines of whole numbers above zero and then one number, separated by blanks or single commas: what nearly all lines of a matrix
  !> file are, in half the time of `read_separated`. Anything else ends the reading.
  subroutine read_entries(text, first, last, whole, values, bad)
    !> Characters of the file
    character, intent(in) :: text(*)
    !> [lines], where each line begins and ends in the text, from 1
    integer(int64), intent(in) :: first(:), last(:)
    !> [lines, whole numbers a line], of up to nine digits
    integer(int32), intent(out) :: whole(:, :)
    !> [lines]
    real(wp), intent(out) :: values(:)
    !> First line that holds anything else; 0: none
    integer, intent(out) :: bad
    integer :: line, field
    integer(int64) :: position, start
    logical :: found

    bad = 0
    do line = 1, size(first)
      position = first(line)
      do field = 1, size(whole, 2)
        call read_whole(text, position, last(line), whole(line, field), found)
        if (.not. found) exit
      end do
      if (found) then
        call skip_blanks(text, position, last(line))
        start = position
        do while (position <= last(line))
          if (text(position) == "," .or. is_blank(text(position))) exit
          position = position + 1
        end do
        found = position > start
        if (found) call read_number(text, start, position - 1, values(line), found)
        call skip_blanks(text, position, last(line))
        found = found .and. position > last(line)
      end if
      if (.not. found) then
        bad = line
        return
      end if
    end do
  end subroutine read_entries

  !> A whole number above zero and the separator after it: blanks, or a comma among them.
  pure subroutine read_whole(text, position, last, whole, found)
    !> Characters of the file
    character, intent(in) :: text(*)
    !> Where it is looked for; then what follows the separator
    integer(int64), intent(inout) :: position
    !> Position of the last character
    integer(int64), intent(in) :: last
    !> Whole number that the characters spell
    integer(int32), intent(out) :: whole
    !> Is there a number?
    logical, intent(out) :: found
    integer(int64), parameter :: most_digits = 9
    integer(int64) :: start
    integer :: digit

    whole = 0
    call skip_blanks(text, position, last)
    start = position
    do while (position <= last)
      digit = iachar(text(position)) - iachar("0")
      if (digit < 0 .or. digit > 9 .or. position - start >= most_digits) exit
      whole = 10*whole + digit
      position = position + 1
    end do
    start = position
    call skip_blanks(text, position, last)
    found = whole > 0 .and. position <= last
    if (.not. found) return
    if (text(position) == ",") then
      position = position + 1
    else
      found = position > start
    end if
  end subroutine read_whole

  !> Fields of lines at fixed positions, as Fortran formats and Nastran write them, side by side without separators.
  subroutine read_columns(text, first, last, begin, width, table, bad)
    !> Characters of the file
    character, intent(in) :: text(*)
    !> [lines], where each line begins and ends in the text, from 1
    integer(int64), intent(in) :: first(:), last(:)
    !> [fields], first character of each field in its line, from 0, and number of characters
    integer, intent(in) :: begin(:), width(:)
    !> [fields, lines]; NaN where there are only blanks
    real(wp), intent(out) :: table(:, :)
    !> First line with a field that is no finite number; 0: none
    integer, intent(out) :: bad
    integer :: line, field
    integer(int64) :: left, right
    logical :: found

    bad = 0
    table = ieee_value(1.0_wp, ieee_quiet_nan)
    do line = 1, size(first)
      do field = 1, size(begin)
        left = first(line) + begin(field)
        right = min(left + width(field) - 1, last(line))
        call skip_blanks(text, left, right)
        if (left > right) cycle
        do while (is_blank(text(right)))
          right = right - 1
        end do
        call read_number(text, left, right, table(field, line), found)
        if (.not. found) then
          bad = line
          return
        end if
      end do
    end do
  end subroutine read_columns

  !> The number that characters `left` to `right` spell; `found` is false if they spell none, or one that is not finite.
  subroutine read_number(text, left, right, number, found)
    !> Characters of the file
    character, intent(in) :: text(*)
    !> Position of the first character of the number; position of the last character of the number
    integer(int64), intent(in) :: left, right
    !> Number that the characters spell
    real(wp), intent(inout) :: number
    !> Is there a number?
    logical, intent(out) :: found
    integer(int64) :: position, mantissa
    integer :: digits, decimals, exponent, shift, spelled
    logical :: negative, point, lost, is_exact
    character :: letter

    found = .false.
    position = left
    negative = text(position) == "-"
    if (negative .or. text(position) == "+") position = position + 1
    mantissa = 0
    digits = 0
    decimals = 0
    point = .false.
    lost = .false.
    do while (position <= right)
      letter = text(position)
      if (letter >= "0" .and. letter <= "9") then
        digits = digits + 1
        if (mantissa < eighteen_digits/10) then
          mantissa = 10*mantissa + (iachar(letter) - iachar("0"))
        else
          lost = .true.
        end if
        if (point) decimals = decimals + 1
      else if (letter == "." .and. .not. point) then
        point = .true.
      else
        exit
      end if
      position = position + 1
    end do
    if (digits == 0) return
    spelled = int(position - left)
    call read_exponent(text, position, right, exponent, found)
    if (.not. found) return
    shift = exponent - decimals
    if (mantissa < fifteen_digits .and. abs(shift) <= 22 .and. .not. lost) then
      number = real(mantissa, wp)
      if (shift >= 0) number = number*powers(shift)
      if (shift < 0) number = number/powers(-shift)
      is_exact = .true.
    else if (abs(shift) <= ubound(powers, 1) .and. .not. lost) then
      call scale_by_power(mantissa, shift, number, is_exact)
    else
      is_exact = .false.
    end if
    if (is_exact) then
      if (negative) number = -number
    else
      call read_by_library(text, left, spelled, exponent, number, found)
    end if
  end subroutine read_number

  !> m 10^k to twice the digits of a double; `is_exact` if its rounding to one cannot be wrong.
  pure subroutine scale_by_power(mantissa, shift, number, is_exact)
    !> Below 2^62
    integer(int64), intent(in) :: mantissa
    !> At most 44, either sign
    integer, intent(in) :: shift
    !> Number that the characters spell
    real(wp), intent(out) :: number
    !> Is the rounding beyond doubt?
    logical, intent(out) :: is_exact
    !> More than the two products, or the two quotients, leave out, relative
    real(wp), parameter :: uncertainty = 2.0_wp**(-98) ! derived
    real(wp) :: high, low, factor, rest, product, error, margin

    high = real(mantissa, wp)
    low = real(mantissa - int(high, int64), wp)
    factor = powers(abs(shift))
    rest = rest_of_powers(abs(shift))
    if (shift >= 0) then
      call multiply(high, factor, product, error)
      error = error + (high*rest + low*factor)
    else
      product = high/factor
      call multiply(product, factor, error, margin)
      error = (((high - error) - margin) + low - product*rest)/factor
    end if
    number = product + error
    margin = abs(product)*uncertainty
    ! What is left of the sum after rounding, moved either way, must still round to the same.
    rest = (product - number) + error
    is_exact = number + (rest + margin) == number .and. number + (rest - margin) == number
  end subroutine scale_by_power

  !> a b = product + error, exactly.
  pure subroutine multiply(a, b, product, error)
    !> Factor of the product
    real(wp), intent(in) :: a, b
    !> Product, rounded; what rounding has taken from it
    real(wp), intent(out) :: product, error
    !> Splits a number in halves of 26 bits (Dekker 1971)
    real(wp), parameter :: splitter = 2.0_wp**27 + 1.0_wp ! derived
    real(wp) :: a_high, a_low, b_high, b_low

    a_high = splitter*a - (splitter*a - a)
    a_low = a - a_high
    b_high = splitter*b - (splitter*b - b)
    b_low = b - b_high
    product = a*b
    error = ((a_high*b_high - product) + a_high*b_low + a_low*b_high) + a_low*b_low
  end subroutine multiply

  !> What follows the digits: nothing, or an exponent up to the last character.
  pure subroutine read_exponent(text, begin, right, exponent, found)
    !> Characters of the file
    character, intent(in) :: text(*)
    !> Position at which the exponent begins; position of the last character of the number
    integer(int64), intent(in) :: begin, right
    !> Power of ten
    integer, intent(out) :: exponent
    !> Is there a number?
    logical, intent(out) :: found
    integer(int64) :: position
    logical :: negative

    exponent = 0
    found = begin > right
    if (found) return
    position = begin
    select case (text(position))
     case ("e", "E", "d", "D")
      position = position + 1
     case default
      ! A bare sign follows, or nothing that belongs to a number.
    end select
    if (position > right) return
    negative = text(position) == "-"
    if (negative .or. text(position) == "+") then
      position = position + 1
    else if (position == begin) then
      return
    end if
    if (position > right .or. right - position > 6) return
    do position = position, right
      if (text(position) < "0" .or. text(position) > "9") return
      exponent = 10*exponent + (iachar(text(position)) - iachar("0"))
    end do
    if (negative) exponent = -exponent
    found = .true.
  end subroutine read_exponent

  !> The C library's reading of a sign, digits and point, with an exponent of base ten.
  subroutine read_by_library(text, left, spelled, exponent, number, found)
    !> Characters of the file
    character, intent(in) :: text(*)
    !> Position of the first character of the number
    integer(int64), intent(in) :: left
    !> Characters up to the exponent; power of ten
    integer, intent(in) :: spelled, exponent
    !> Number that the characters spell
    real(wp), intent(inout) :: number
    !> Is there a number?
    logical, intent(out) :: found
    character(kind=c_char), target :: copy(longest + 12)
    character(12) :: tail
    type(ieee_status_type) :: before
    integer :: k, length

    found = spelled <= longest
    if (.not. found) return
    do k = 1, spelled
      copy(k) = text(left + k - 1)
    end do
    length = spelled
    if (exponent /= 0) then
      call write_exponent(exponent, tail)
      do k = 1, len_trim(tail)
        copy(length + k) = tail(k:k)
      end do
      length = length + len_trim(tail)
    end if
    copy(length + 1) = c_null_char
    ! A number too large is shown by its value, not by an exception.
    call ieee_get_status(before)
    call ieee_set_halting_mode(ieee_overflow, .false.)
    number = strtod(copy, c_null_ptr)
    call ieee_set_status(before)
    found = ieee_is_finite(number)
  end subroutine read_by_library

  !> e-12 of -12, without the cost of a formatted write.
  pure subroutine write_exponent(exponent, tail)
    !> Power of ten
    integer, intent(in) :: exponent
    !> The exponent as characters
    character(12), intent(out) :: tail
    integer :: rest, k

    tail = "e"
    if (exponent < 0) tail = "e-"
    k = len_trim(tail) + 1
    rest = abs(exponent)
    if (rest >= 10000) rest = 9999
    tail(k:k + 3) = achar(iachar("0") + rest/1000)//achar(iachar("0") + mod(rest/100, 10)) &
                    //achar(iachar("0") + mod(rest/10, 10))//achar(iachar("0") + mod(rest, 10))
  end subroutine write_exponent

  pure subroutine skip_blanks(text, position, last)
    !> Characters of the file
    character, intent(in) :: text(*)
    !> Place of a character
    integer(int64), intent(inout) :: position
    !> Position of the last character
    integer(int64), intent(in) :: last

    do while (position <= last)
      if (.not. is_blank(text(position))) return
      position = position + 1
    end do
  end subroutine skip_blanks

  !> Blank, tab or carriage return
  pure elemental function is_blank(letter) result(blank)
    character, intent(in) :: letter
    logical :: blank

    select case (iachar(letter))
     case (9, 13, 32)
      blank = .true.
     case default
      blank = .false.
    end select
  end function is_blank
end module attrito_core_text_numbers
