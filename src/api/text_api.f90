!> Reading numbers out of text, as C calls it.
module attrito_api_text
  use, intrinsic :: iso_c_binding
  use, intrinsic :: iso_fortran_env, only: int64
  use attrito_core_text_numbers, only: read_columns, read_entries, read_separated
  implicit none
  private
  public :: attrito_read_numbers, attrito_read_entries

contains

  !> Table of numbers [fields, lines] from lines of text, NaN where a field is empty; returns the first line, from 1, that
  !> does not hold numbers, or 0. Widths of zero: fields are separated by blanks or commas.
  function attrito_read_numbers(text, lines, first, last, fields, begin, width, table) bind(c) result(bad)
    !> Text, as C hands it over
    character(kind=c_char), intent(in) :: text(*)
    !> How many there are
    integer(c_int), value :: lines, fields
    !> Where each line begins and where the next character after it stands, from 0
    integer(c_int64_t), intent(in) :: first(lines), last(lines)
    !> Where each field begins in its line, from 0, and its number of characters
    integer(c_int), intent(in) :: begin(fields), width(fields)
    !> Numbers that are read
    real(c_double), intent(out) :: table(fields, lines)
    integer(c_int) :: bad

    if (all(width == 0)) then
      call read_separated(text, first + 1_int64, int(last, int64), table, bad)
    else
      call read_columns(text, first + 1_int64, int(last, int64), begin, width, table, bad)
    end if
  end function attrito_read_numbers

  !> Whole numbers above zero [fields, lines] and, last in each line, a value [lines]; returns the first line, from 1, that holds
  !> anything else, or 0.
  function attrito_read_entries(text, lines, first, last, fields, whole, values) bind(c) result(bad)
    !> Text, as C hands it over
    character(kind=c_char), intent(in) :: text(*)
    !> How many there are
    integer(c_int), value :: lines, fields
    !> Where each line begins and where the next character after it stands, from 0
    integer(c_int64_t), intent(in) :: first(lines), last(lines)
    !> Numbers that are read
    integer(c_int32_t), intent(out) :: whole(lines, fields)
    !> Numbers that are read
    real(c_double), intent(out) :: values(lines)
    integer(c_int) :: bad

    call read_entries(text, first + 1_int64, int(last, int64), whole, values, bad)
  end function attrito_read_entries
end module attrito_api_text
