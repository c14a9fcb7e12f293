!> C interface of what both sides must agree on: names that cross as numbers, and sizes of structures.
module attrito_api_describe
  use, intrinsic :: iso_c_binding
  use attrito_contact_law_laws, only: law_names
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_integrate_run, only: reason_none, reason_settling, reason_step, reason_diverged
  use attrito_integrate_schemes, only: scheme_event, scheme_central_difference, scheme_newmark, scheme_hht, &
                                       scheme_generalised_alpha, scheme_exponential
  use attrito_linear_references, only: reference_stuck, reference_frictionless, reference_tangent
  use attrito_model_structure, only: damping_none, damping_viscous, damping_ratio, damping_mass, damping_loss_factor
  use attrito_solve_outcomes, only: outcome_names
  use attrito_output_point_series, only: state_names
  use attrito_peak_amplitude, only: half_range, first_harmonic
  use attrito_peak_condition, only: parameter_level, parameter_preload
  use attrito_reduce_report, only: step_names
  use attrito_solve_strategy_table, only: strategy_type, strategies
  use attrito_sensitivity_quantities, only: quantity_amplitude, quantity_mean, quantity_dissipated_energy, quantity_t1_mean, &
                                            quantity_t2_mean, quantity_n_mean, quantity_first_cosine, &
                                            quantity_first_sine
  use attrito_stability_examination, only: by_monodromy, by_hill, balanced_orbit, exact_orbit, automatic_orbit
  use attrito_stability_multipliers, only: kind_names
  use attrito_stability_verdict, only: unstable, stable, indeterminate
  use attrito_api_backbone, only: backbone_type
  use attrito_api_bifurcations, only: bifurcation_report_type, fold, contact_fold, flip, neimark_sacker, branch_point, &
                                      contact_crossing
  use attrito_api_branches, only: cold, in_motion, from_preload
  use attrito_api_integrate, only: scene_type, run_options_type => options_type, run_report_type => report_type
  use attrito_api_message, only: say
  use attrito_api_peak, only: peak_type
  use attrito_peak_endings, only: ending_names
  use attrito_api_reduce, only: reduction_options_type => options_type, reduction_report_type => report_type
  use attrito_api_sensitivity, only: rates_type
  use attrito_api_session, only: contact_law_type
  use attrito_api_quasi_static, only: quasi_static_type
  use attrito_api_solver, only: solver_options_type => options_type, point_type
  use attrito_api_stability, only: examination_report_type
  implicit none
  private

  character(*), parameter :: end_of_line = new_line('a')

contains

  !> Describe the interface in words, a line each: `names OF name=number ...` of an enumeration, `size OF bytes` of a structure,
  !> `row OF cell | cell ...` of a table that documentation shows.
  !> Returns the room that the text takes with the null character at its end; what does not fit is left out.
  integer(c_int) function attrito_describe(length, text) bind(c)
    !> Room for the message, characters
    integer(c_int), value :: length
    !> Text, as C hands it over
    character(kind=c_char), intent(out) :: text(length)
    character(:), allocatable :: whole

    whole = enumerations()//sizes()//rows_of_strategies()
    call say(whole, text)
    attrito_describe = len(whole) + 1
  end function attrito_describe

  !> Every enumeration that crosses as a number.
  function enumerations() result(text)
    character(:), allocatable :: text
    type(strategy_type), allocatable :: table(:)

    table = strategies()
    text = counted('outcomes', outcome_names)// &
           counted('strategies', table%name)// &
           counted('endings', ending_names)// &
           counted('states', state_names)// &
           counted('laws', law_names)// &
           counted('multiplier_kinds', kind_names)// &
           counted('reduction_steps', step_names)// &
           numbered('damping_kinds', [character(11) :: 'none', 'viscous', 'ratio', 'mass', 'loss_factor'], &
                    [damping_none, damping_viscous, damping_ratio, damping_mass, damping_loss_factor])// &
           numbered('engines', [character(9) :: 'monodromy', 'hill'], [by_monodromy, by_hill])// &
           numbered('orbits', [character(7) :: 'balance', 'exact', 'auto'], [balanced_orbit, exact_orbit, automatic_orbit])// &
           numbered('verdicts', [character(13) :: 'unstable', 'stable', 'indeterminate'], [unstable, stable, indeterminate])// &
           numbered('bifurcation_kinds', [character(16) :: 'fold', 'contact_fold', 'flip', 'neimark_sacker', 'branch_point', &
                                          'contact_crossing'], [fold, contact_fold, flip, neimark_sacker, branch_point, &
                                                                contact_crossing])// &
           numbered('starts', [character(12) :: 'cold', 'in_motion', 'from_preload'], [cold, in_motion, from_preload])// &
           numbered('references', [character(12) :: 'stuck', 'frictionless', 'tangent'], &
                    [reference_stuck, reference_frictionless, reference_tangent])// &
           numbered('amplitudes', [character(14) :: 'half_range', 'first_harmonic'], [half_range, first_harmonic])// &
           numbered('parameters', [character(7) :: 'level', 'preload'], [parameter_level, parameter_preload])// &
           numbered('quantities', [character(17) :: 'amplitude', 'mean', 'dissipated_energy', 't1_mean', 't2_mean', 'n_mean', &
                                                 'first_cosine', 'first_sine'], &
                    [quantity_amplitude, quantity_mean, quantity_dissipated_energy, quantity_t1_mean, quantity_t2_mean, &
                     quantity_n_mean, quantity_first_cosine, quantity_first_sine])// &
           numbered('schemes', [character(18) :: 'event', 'central_difference', 'newmark', 'hht', 'generalised_alpha', &
                                'exponential'], [scheme_event, scheme_central_difference, scheme_newmark, scheme_hht, &
                                                 scheme_generalised_alpha, scheme_exponential])// &
           numbered('reasons', [character(8) :: 'none', 'settling', 'step', 'diverged'], &
                    [reason_none, reason_settling, reason_step, reason_diverged])// &
           numbered('regimes', [character(5) :: 'stick', 'slip', 'open'], [regime_stick, regime_slip, regime_open])
  end function enumerations

  !> Every structure that crosses, by its name in attrito.h.
  function sizes() result(text)
    character(:), allocatable :: text
    type(contact_law_type) :: law
    type(solver_options_type) :: solver_options
    type(point_type) :: point
    type(peak_type) :: peak
    type(backbone_type) :: backbone
    type(quasi_static_type) :: quasi_static
    type(examination_report_type) :: examination_report
    type(bifurcation_report_type) :: bifurcation_report
    type(rates_type) :: rates
    type(scene_type) :: scene
    type(run_options_type) :: run_options
    type(run_report_type) :: run_report
    type(reduction_options_type) :: reduction_options
    type(reduction_report_type) :: reduction_report

    text = sized('contact_law', c_sizeof(law))// &
           sized('solver_options', c_sizeof(solver_options))// &
           sized('point', c_sizeof(point))// &
           sized('peak', c_sizeof(peak))// &
           sized('backbone', c_sizeof(backbone))// &
           sized('quasi_static', c_sizeof(quasi_static))// &
           sized('examination_report', c_sizeof(examination_report))// &
           sized('bifurcation_report', c_sizeof(bifurcation_report))// &
           sized('rates', c_sizeof(rates))// &
           sized('integrate_scene', c_sizeof(scene))// &
           sized('integrate_options', c_sizeof(run_options))// &
           sized('integrate_report', c_sizeof(run_report))// &
           sized('reduce_options', c_sizeof(reduction_options))// &
           sized('reduce_report', c_sizeof(reduction_report))
  end function sizes

  !> The table of fallback strategies.
  function rows_of_strategies() result(text)
    character(:), allocatable :: text
    type(strategy_type), allocatable :: table(:)
    integer :: i

    table = strategies()
    text = ''
    do i = 1, size(table)
      text = text//'row strategies '//trim(table(i)%name)//' | '//trim(table(i)%path)//' | '//trim(table(i)%condition)//' | '// &
             trim(table(i)%cost)//' | '//trim(merge('yes', 'no ', table(i)%costs_little))//end_of_line
    end do
  end function rows_of_strategies

  !> The line of an enumeration whose names are counted from 0.
  pure function counted(enumeration, names) result(line)
    !> Name of the enumeration
    character(*), intent(in) :: enumeration
    !> Names that numbers stand for
    character(*), intent(in) :: names(:)
    character(:), allocatable :: line
    integer :: i

    line = numbered(enumeration, names, [(i - 1, i=1, size(names))])
  end function counted

  !> The line of an enumeration with a number for each name.
  pure function numbered(enumeration, names, numbers) result(line)
    !> Name of the enumeration
    character(*), intent(in) :: enumeration
    !> Names that numbers stand for
    character(*), intent(in) :: names(:)
    !> Numbers of the state
    integer, intent(in) :: numbers(:)
    character(:), allocatable :: line
    character(12) :: number
    integer :: i

    line = 'names '//enumeration
    do i = 1, size(names)
      write (number, '(i0)') numbers(i)
      line = line//' '//trim(names(i))//'='//trim(number)
    end do
    line = line//end_of_line
  end function numbered

  !> The line of a structure.
  pure function sized(structure, bytes) result(line)
    !> Mass, stiffness, damping, loads and monitors
    character(*), intent(in) :: structure
    !> Size of the structure
    integer(c_size_t), intent(in) :: bytes
    character(:), allocatable :: line
    character(20) :: number

    write (number, '(i0)') bytes
    line = 'size '//structure//' '//trim(number)//end_of_line
  end function sized
end module attrito_api_describe
