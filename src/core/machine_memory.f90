!> What the machine has left, and what this process has used at most, as Linux reports them.
module attrito_core_machine_memory
  use, intrinsic :: iso_c_binding, only: c_int, c_size_t
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: free_megabytes, peak_megabytes, reset_peak, return_memory

  interface
    integer(c_int) function malloc_trim(pad) bind(c)
      import :: c_int, c_size_t
      !> Bytes to leave free at the top of the heap
      integer(c_size_t), value :: pad
    end function malloc_trim
  end interface

contains

  !> Memory that can be had without swapping, in megabytes, within the limit of the process's group; huge where nobody says.
  function free_megabytes() result(megabytes)
    real(wp) :: megabytes
    character(*), parameter :: groups = '/sys/fs/cgroup/'

    megabytes = min(value_after('/proc/meminfo', 'MemAvailable:')/1024.0_wp, &
                    (value_after(groups//'memory.max', '') - value_after(groups//'memory.current', '', 0.0_wp))/2.0_wp**20, &
                    (value_after(groups//'memory/memory.limit_in_bytes', '') &
                     - value_after(groups//'memory/memory.usage_in_bytes', '', 0.0_wp))/2.0_wp**20)
  end function free_megabytes

  !> Most memory that this process has held since the start, or since the last reset, in megabytes; 0 where nobody says.
  function peak_megabytes() result(megabytes)
    real(wp) :: megabytes

    megabytes = value_after('/proc/self/status', 'VmHWM:', 0.0_wp)/1024.0_wp
  end function peak_megabytes

  !> Give what was released back to the system: Open MPI makes the C library keep it.
  subroutine return_memory()
    integer(c_int) :: released

    released = malloc_trim(0_c_size_t)
  end subroutine return_memory

  !> Let the peak start again from what is held now.
  subroutine reset_peak()
    integer :: unit, status

    open (newunit=unit, file='/proc/self/clear_refs', action='write', iostat=status)
    if (status /= 0) return
    write (unit, '(a)') '5'
    close (unit)
  end subroutine reset_peak

  !> The number behind a word at the start of a line of a file; `otherwise` (huge if absent) where there is none.
  function value_after(path, word, otherwise) result(value)
    !> File to read; word that the line begins with
    character(*), intent(in) :: path, word
    !> What to return without such a line
    real(wp), intent(in), optional :: otherwise
    real(wp) :: value
    character(200) :: line
    integer :: unit, status

    value = huge(value)
    if (present(otherwise)) value = otherwise
    open (newunit=unit, file=path, action='read', status='old', iostat=status)
    if (status /= 0) return
    do
      read (unit, '(a)', iostat=status) line
      if (status /= 0) exit
      if (index(line, word) /= 1) cycle
      ! A group without a limit says `max`, which is no number.
      call read_number(line(len(word) + 1:), value)
      exit
    end do
    close (unit)
  end function value_after

  pure subroutine read_number(text, value)
    !> Line of the file
    character(*), intent(in) :: text
    !> Number in the line
    real(wp), intent(inout) :: value
    real(wp) :: number
    integer :: status

    read (text, *, iostat=status) number
    if (status == 0) value = number
  end subroutine read_number
end module attrito_core_machine_memory
