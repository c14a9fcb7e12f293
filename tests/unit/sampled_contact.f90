!> Contact forces of a periodic motion by alternating frequency and time, on equally spaced samples.
!>
!> The force is split as lambda = K_c d + g(d): the stuck contact's springs and the deviation from them,
!>
!> $$ g_t = -k_t w, \qquad g_n = N - k_n v $$
!>
!> so that a stuck contact has a constant g and no Jacobian. Residual and exact Jacobian come from one march.
!> Source: Cameron & Griffin 1989, doi:10.1115/1.3176036; Zucca & Firrone 2014, eqs. (4)-(8), doi:10.1016/j.jsv.2013.09.032.
module attrito_testing_sampled_contact
  use attrito_core_kinds, only: wp, pi, two_pi
  use attrito_model_contacts, only: contact_type
  use attrito_contact_forces, only: contact_forces_type, stay_stuck, hold_slider, released
  use attrito_contact_fourier, only: fourier_type
  use attrito_contact_friction_disc, only: differentiate_slide_on_disc
  use attrito_contact_friction_line, only: slide_along_line, slider_interval, side_landed
  use attrito_contact_slider_projection, only: slider_projection_type, project_slider, projection_gradient
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open, state_stuck, state_shaken_down, state_slipping, &
                                   state_open
  use attrito_contact_stuck_bound, only: is_stuck_by_bound, is_stuck_by_samples
  implicit none
  private
  public :: evaluate_contact_by_samples, contact_samples_type, sample_contact, slide_on_disc

  !> What happens at the samples of one period
  type :: contact_samples_type
    !> Is no gradient wanted, nor whether the loop forgets its start?
    logical :: without_gradients = .false.
    !> Displacement and force [J, rows]; slider [J, 2]
    real(wp), allocatable :: displacement(:, :), force(:, :), slider(:, :)
    !> Slip radius F/k_t, where open less than zero by what is missing, and its derivative by v [J]
    real(wp), allocatable :: radius(:), slope(:)
    !> Does it touch? [J]
    logical, allocatable :: closed(:)
    !> One of `regime_...` [J]
    integer, allocatable :: regimes(:)
    !> One tangent: sample and side of the slider's last clamp [J]
    integer, allocatable :: origins(:), sides(:)
    !> Two tangents: gradient of the slider by coefficients (t1, t2, n) and start slider [3 k + 2, 2, J]
    real(wp), allocatable :: gradients(:, :, :)
    !> Slider at the start of the last march, and what that march moves it by
    real(wp) :: start(2) = 0.0_wp, moved_by(2) = 0.0_wp
    !> Two tangents: where the slider can rest, if anywhere, and if it does the derivative of that place [2, 3 k]
    type(slider_projection_type) :: nearest
    real(wp), allocatable :: projection_gradient(:, :)
    !> Did the slider move before the last march, has it come to rest since, and does the loop forget its start?
    logical :: moved = .false., rests = .false., forgets = .false.
  end type contact_samples_type

contains

  !> Forces and Jacobian of one contact. Two tangents: a slider that is not periodic goes to the nearest place where it can rest; if
  !> there is none it is marched from where it is, once on its way and once for the record. A periodic one is the unknown start of one
  !> march.
  subroutine evaluate_contact_by_samples(law, fourier, motion, slider, periodic, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Transforms between coefficients and samples
    type(fourier_type), intent(in) :: fourier
    !> Coefficients of relative displacement [k, rows]
    real(wp), intent(in) :: motion(:, :)
    !> Slider at the start of the first march [2]
    real(wp), intent(in) :: slider(2)
    !> Is the slider to return after one period?
    logical, intent(in) :: periodic
    !> Forces; `deviation` is allocated by the caller, for as many coefficients as it wants
    type(contact_forces_type), intent(inout) :: forces
    type(contact_samples_type) :: samples
    real(wp), allocatable :: deviation(:, :)

    forces%periodic = periodic .and. law%tangents == 2
    if (is_surely_stuck(law, fourier, motion, slider)) then
      call stay_stuck(law, slider, size(motion, 1), forces)
      return
    end if
    samples%without_gradients = forces%without_jacobian
    call sample_contact(law, fourier, motion, slider, merge(1, 2, forces%periodic), samples)
    deviation = deviation_at_samples(law, samples)
    call fourier%to_coefficients(deviation, forces%deviation)
    call classify(samples, forces)
    if (.not. forces%without_jacobian) call differentiate(law, fourier, samples, forces)
    if (forces%state == state_stuck) call hold_slider(law, (forces%slider), forces)
  end subroutine evaluate_contact_by_samples

  !> g at the samples: what the stuck contact's springs do not have of the force.
  function deviation_at_samples(law, samples) result(deviation)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> What the contact does at the samples of one period
    type(contact_samples_type), intent(in) :: samples
    real(wp), allocatable :: deviation(:, :)
    integer :: i

    deviation = samples%force
    do i = 1, law%tangents
      deviation(:, i) = -law%tangential_stiffness*samples%slider(:, i)
    end do
    i = law%tangents + 1
    deviation(:, i) = samples%force(:, i) - law%normal_stiffness*samples%displacement(:, i)
  end function deviation_at_samples

  !> Does the contact stick whatever happens between samples? What passes is what a march would find: stuck where it is.
  logical function is_surely_stuck(law, fourier, motion, slider) result(sticks)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Transforms between coefficients and samples
    type(fourier_type), intent(in) :: fourier
    !> Coefficients of relative displacement [k, rows]
    real(wp), intent(in) :: motion(:, :)
    !> Slider at the start [2]
    real(wp), intent(in) :: slider(2)
    real(wp) :: displacement(fourier%coarse_samples, size(motion, 2))

    sticks = is_stuck_by_bound(law, motion, slider)
    if (sticks .or. law%tangents == 1 .or. size(motion, 1) > fourier%coarse_samples) return
    call fourier%to_coarse_samples(motion, displacement)
    sticks = is_stuck_by_samples(law, displacement, motion, slider)
  end function is_surely_stuck

  !> March the law over the samples of one period until its slider repeats.
  subroutine sample_contact(law, fourier, motion, slider, passes, samples)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Transforms between coefficients and samples
    type(fourier_type), intent(in) :: fourier
    !> Coefficients of relative displacement [k, rows]
    real(wp), intent(in) :: motion(:, :)
    !> Slider at the start of the first march [2]
    real(wp), intent(in) :: slider(2)
    !> Marches over the period
    integer, intent(in) :: passes
    !> What the contact does at the samples of one period
    type(contact_samples_type), intent(inout) :: samples
    integer :: i, n

    n = law%tangents + 1
    allocate (samples%displacement(fourier%samples, n), samples%slider(fourier%samples, 2), samples%regimes(fourier%samples))
    call fourier%to_samples(motion, samples%displacement)
    samples%slider = 0.0_wp
    samples%force = samples%displacement
    associate (normal => samples%force(:, n))
      normal = law%normal_force(samples%displacement(:, n))
      samples%closed = normal >= law%touching_force(motion(:, n))
      ! Negative where it is open: the marches find landing between samples.
      if (allocated(samples%radius)) deallocate (samples%radius, samples%slope)
      allocate (samples%radius(fourier%samples), samples%slope(fourier%samples))
      call law%slip_force(normal, samples%radius, samples%slope)
      samples%radius = samples%radius/law%tangential_stiffness
      samples%slope = samples%slope*law%normal_stiffness/law%tangential_stiffness
      normal = max(normal, 0.0_wp)
    end associate
    if (law%tangents == 1) then
      call march_line(samples, slider(1))
    else
      samples%nearest = project_slider(samples%displacement(:, 1:2), samples%radius, slider)
      ! A periodic slider that could rest elsewhere is marched all the same: it rests once it is marched from where it is.
      if (samples%nearest%exists .and. (passes > 1 .or. samples%nearest%count == 0)) then
        call rest(fourier, samples, slider)
      else
        call march_disc(law, fourier, samples, slider, passes)
      end if
    end if
    where (samples%closed .and. samples%regimes == regime_open) samples%regimes = regime_slip
    do i = 1, law%tangents
      samples%force(:, i) = law%tangential_stiffness*(samples%displacement(:, i) - samples%slider(:, i))
    end do
  end subroutine sample_contact

  !> One tangent: the first march reaches the steady loop, the second records it.
  subroutine march_line(samples, slider)
    !> What the contact does at the samples of one period
    type(contact_samples_type), intent(inout) :: samples
    !> Slider at the start
    real(wp), intent(in) :: slider
    real(wp) :: w, low, high
    integer :: origin, side

    allocate (samples%origins(size(samples%radius)), samples%sides(size(samples%radius)))
    w = slider
    origin = 0
    side = 0
    associate (u => samples%displacement(:, 1), radius => samples%radius)
      call slide_along_line(u, radius, w, origin, side, samples%slider(:, 1), samples%origins, samples%sides, samples%regimes)
      samples%moved = origin > 0
      samples%start(1) = w
      call slide_along_line(u, radius, w, origin, side, samples%slider(:, 1), samples%origins, samples%sides, samples%regimes)
      call slider_interval(u, radius, low, high)
    end associate
    samples%forgets = low >= high
  end subroutine march_line

  !> Two tangents: the slider rests all over the period, at the nearest place where it can.
  subroutine rest(fourier, samples, slider)
    !> Transforms between coefficients and samples
    type(fourier_type), intent(in) :: fourier
    !> What the contact does at the samples of one period
    type(contact_samples_type), intent(inout) :: samples
    !> Where it was
    real(wp), intent(in) :: slider(2)

    samples%start = samples%nearest%slider
    samples%slider = spread(samples%start, 1, size(samples%radius))
    samples%regimes = regime_stick
    samples%moved = samples%nearest%count > 0
    samples%rests = .true.
    if (samples%without_gradients) return
    samples%projection_gradient = projection_gradient(samples%nearest, samples%displacement(:, 1:2), samples%radius, fourier%basis, &
                                                samples%slope, slider)
  end subroutine rest

  !> Two tangents, slipping: a fixed number of marches; the last is the answer. A slider that is not periodic starts where it came
  !> closest to rest, so that forces are continuous where places to rest shrink to a point and vanish.
  subroutine march_disc(law, fourier, samples, slider, passes)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Transforms between coefficients and samples
    type(fourier_type), intent(in) :: fourier
    !> What the contact does at the samples of one period
    type(contact_samples_type), intent(inout) :: samples
    !> Slider at the start
    real(wp), intent(in) :: slider(2)
    !> How often the period is marched
    integer, intent(in) :: passes
    real(wp), allocatable :: gradient(:, :)
    real(wp) :: w(2)
    integer :: pass, k

    k = fourier%coefficients
    w = slider
    if (passes > 1) w = samples%nearest%slider
    if (.not. samples%without_gradients) then
      allocate (gradient(3*k + 2, 2), source=0.0_wp)
      allocate (samples%gradients(3*k + 2, 2, fourier%samples))
      if (passes > 1) gradient(:3*k, :) = transpose(projection_gradient(samples%nearest, samples%displacement(:, 1:2), &
                                                                        samples%radius, fourier%basis, samples%slope, slider))
    end if
    do pass = 1, passes
      samples%start = w
      if (samples%without_gradients) then
        call slide_on_disc(samples%displacement(:, 1:2), samples%radius, w, samples%slider, samples%regimes)
      else
        gradient(3*k + 1:, :) = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
        call differentiate_slide_on_disc(samples%displacement(:, 1:2), samples%radius, fourier%basis, samples%slope, w, gradient, &
                                         samples%slider, samples%gradients, samples%regimes)
      end if
      if (pass < passes) samples%moved = samples%moved .or. any(samples%regimes /= regime_stick)
    end do
    samples%moved_by = w - samples%start
    if (samples%without_gradients) return
    samples%forgets = largest_singular_value(gradient(3*k + 1:, :)) < 1.0_wp - 1.0e-9_wp
  end subroutine march_disc

  !> March one period of samples, from the last one, without the gradient.
  subroutine slide_on_disc(u, r, w, slider, regimes)
    !> Relative displacement [J, 2]; slip radius [J]
    real(wp), intent(in) :: u(:, :), r(:)
    !> Slider at the start, then at the end [2]
    real(wp), intent(inout) :: w(2)
    !> Slider after each sample [J, 2]
    real(wp), intent(out) :: slider(:, :)
    !> Regime at each sample [J]
    integer, intent(out) :: regimes(:)
    real(wp) :: basis(0, size(r)), slope(size(r)), gradient(2, 2), gradients(2, 2, size(r))

    slope = 0.0_wp
    gradient = 0.0_wp
    call differentiate_slide_on_disc(u, r, basis, slope, w, gradient, slider, gradients, regimes)
  end subroutine slide_on_disc

  !> Largest singular value of a 2 x 2 matrix.
  pure real(wp) function largest_singular_value(a)
    !> Matrix, 2 x 2
    real(wp), intent(in) :: a(2, 2)
    real(wp) :: square_sum, determinant

    square_sum = sum(a**2)
    determinant = a(1, 1)*a(2, 2) - a(1, 2)*a(2, 1)
    largest_singular_value = sqrt(0.5_wp*(square_sum + sqrt(max(square_sum**2 - 4.0_wp*determinant**2, 0.0_wp))))
  end function largest_singular_value

  !> State and fractions of the period.
  pure subroutine classify(samples, forces)
    !> What the contact does at the samples of one period
    type(contact_samples_type), intent(in) :: samples
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    real(wp) :: total
    integer :: j

    total = real(size(samples%regimes), wp)
    forces%stick = count(samples%regimes == regime_stick)/total
    forces%slip = count(samples%regimes == regime_slip)/total
    forces%open = count(samples%regimes == regime_open)/total
    if (forces%lists_slip) then
      associate (slips => pack([(j, j=1, size(samples%regimes))], samples%regimes == regime_slip))
        forces%slips = transpose(reshape(two_pi/total*[slips - 1, slips], [size(slips), 2]))
      end associate
    end if
    forces%slider = samples%start
    forces%moved = samples%moved_by
    forces%may_stick = samples%nearest%exists
    forces%unique = samples%forgets
    if (.not. any(samples%closed)) then
      forces%state = state_open
    else if (any(samples%regimes /= regime_stick)) then
      forces%state = state_slipping
    else
      forces%state = merge(state_shaken_down, state_stuck, samples%moved)
    end if
  end subroutine classify

  !> Jacobian d g / d d; none for a contact that stays stuck, the mean only for one that has shaken down.
  subroutine differentiate(law, fourier, samples, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Transforms between coefficients and samples
    type(fourier_type), intent(in) :: fourier
    !> What the contact does at the samples of one period
    type(contact_samples_type), intent(in) :: samples
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    integer :: k, n, row

    k = fourier%coefficients
    n = law%tangents*k
    forces%active = spread(.false., 1, n + k)
    if (allocated(forces%jacobian)) deallocate (forces%jacobian)
    if (forces%state == state_stuck) return
    allocate (forces%jacobian(n + k, n + k), source=0.0_wp)
    if (samples%rests) then
      forces%jacobian([1, k + 1], :) = -law%tangential_stiffness*samples%projection_gradient
    else if (law%tangents == 1) then
      call slider_gradient_line(fourier, samples, forces%jacobian(:k, :))
      forces%jacobian(:n, :) = -law%tangential_stiffness*forces%jacobian(:n, :)
    else
      call slider_gradient_disc(law, fourier, samples, forces)
    end if
    forces%active(:n) = .true.
    if (forces%state == state_shaken_down) then
      forces%active(:n) = [(modulo(row - 1, k) == 0, row=1, n)]
      do row = 1, n
        if (.not. forces%active(row)) forces%jacobian(row, :) = 0.0_wp
      end do
    end if
    if (all(samples%closed)) return
    forces%active(n + 1:) = .true.
    call add_open_springs(law, fourier, samples, forces%jacobian(n + 1:, n + 1:))
  end subroutine differentiate

  !> Coefficients of the slider per coefficient of (u, v): w_j = u_k + side_k r_k, k the sample of its last clamp; or where it
  !> landed before k, u(t) at r(t) = 0, t = -r_a/(r_k - r_a): dw = du(t) - (u_k - u_a)/(r_k - r_a) dr(t).
  subroutine slider_gradient_line(fourier, samples, gradient)
    !> Transforms between coefficients and samples
    type(fourier_type), intent(in) :: fourier
    !> What the contact does at the samples of one period
    type(contact_samples_type), intent(in) :: samples
    !> Gradient [k, 2 k]
    real(wp), intent(out) :: gradient(:, :)
    real(wp), allocatable :: gradients(:, :, :), analysed(:, :, :)
    real(wp) :: time
    integer :: j, k, before

    k = fourier%coefficients
    allocate (gradients(k, 2, fourier%samples), analysed(k, k, 2))
    do j = 1, fourier%samples
      associate (origin => samples%origins(j), u => samples%displacement(:, 1), r => samples%radius, slope => samples%slope, &
                 of_u => gradients(:, 1, j), of_v => gradients(:, 2, j), basis => fourier%basis)
        if (origin == 0) then
          gradients(:, :, j) = 0.0_wp
        else if (samples%sides(j) == side_landed) then
          before = modulo(origin - 2, fourier%samples) + 1
          time = -r(before)/(r(origin) - r(before))
          of_u = basis(:, before) + time*(basis(:, origin) - basis(:, before))
          of_v = -((u(origin) - u(before))/(r(origin) - r(before))) &
                 *((1.0_wp - time)*slope(before)*basis(:, before) + time*slope(origin)*basis(:, origin))
        else
          of_u = basis(:, origin)
          of_v = merge(samples%sides(j)*slope(origin), 0.0_wp, samples%closed(origin))*of_u
        end if
      end associate
    end do
    call fourier%analyse_gradients(gradients, analysed)
    gradient(:, :k) = analysed(:, :, 1)
    gradient(:, k + 1:) = analysed(:, :, 2)
  end subroutine slider_gradient_line

  !> Tangential rows of the Jacobian from the march's gradient by (u1, u2, v) and start slider; a periodic slider follows the motion.
  subroutine slider_gradient_disc(law, fourier, samples, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Transforms between coefficients and samples
    type(fourier_type), intent(in) :: fourier
    !> What the contact does at the samples of one period
    type(contact_samples_type), intent(in) :: samples
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    !> What a period keeps but for rounding stays where it is, rather than moving without limit.
    real(wp), parameter :: kept = 1.0_wp - 1.0e-8_wp ! derived
    real(wp), allocatable :: gradient(:, :, :)
    integer :: i, k

    k = fourier%coefficients
    allocate (gradient(k, 3*k + 2, 2))
    call fourier%analyse_gradients(samples%gradients, gradient)
    gradient = -law%tangential_stiffness*gradient
    do i = 1, 2
      forces%jacobian((i - 1)*k + 1:i*k, :) = gradient(:, :3*k, i)
    end do
    if (.not. forces%periodic) return
    associate (link => forces%link, last => samples%gradients(:, :, fourier%samples))
      link%by_motion = transpose(last(:3*k, :))
      link%force = reshape([gradient(:, 3*k + 1, :), gradient(:, 3*k + 2, :)], [2*k, 2])
      link%holding = -kept*transpose(last(3*k + 1:, :))
      do i = 1, 2
        link%holding(i, i) = link%holding(i, i) + 1.0_wp
      end do
      forces%jacobian(:2*k, :) = forces%jacobian(:2*k, :) + matmul(link%force, released(link%holding, link%by_motion))
    end associate
  end subroutine slider_gradient_disc

  !> Normal rows of the Jacobian: minus the spring wherever open.
  subroutine add_open_springs(law, fourier, samples, jacobian)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Transforms between coefficients and samples
    type(fourier_type), intent(in) :: fourier
    !> What the contact does at the samples of one period
    type(contact_samples_type), intent(in) :: samples
    !> [k, k]
    real(wp), intent(inout) :: jacobian(:, :)
    real(wp), allocatable :: gradients(:, :, :), analysed(:, :, :)
    integer :: j, k

    k = fourier%coefficients
    allocate (gradients(k, 1, fourier%samples), analysed(k, k, 1))
    do j = 1, fourier%samples
      gradients(:, 1, j) = merge(0.0_wp, -law%normal_stiffness, samples%closed(j))*fourier%basis(:, j)
    end do
    call fourier%analyse_gradients(gradients, analysed)
    jacobian = jacobian + analysed(:, :, 1)
  end subroutine add_open_springs
end module attrito_testing_sampled_contact
