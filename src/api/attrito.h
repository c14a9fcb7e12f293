/* The C interface of attrito. Made by script/header from the Fortran sources; a test compares both.
 *
 * Arrays are C's: the last index runs fastest. A status is 0 (done), 1 (the numerics), 2 (the input) or 3 (a file); its
 * message is written to the room that the caller gives. A communicator is Fortran's handle (MPI_Comm_c2f), of MPI that
 * is initialised. A handle is made by attrito_create or attrito_integrator_create, and given back by attrito_destroy or
 * attrito_integrator_destroy.
 */
#ifndef ATTRITO_H
#define ATTRITO_H

#ifdef __cplusplus
extern "C" {
#endif

/* An entry of a series: its path in the file; `real64` or `int32`; its sizes, slowest first; its numbers; what they are, their
 * unit, and, where they count names, these with commas between. */
typedef void (*attrito_series_callback)(const char *path, const char *kind, int dimensions, const int *extent,
    const double *values, const char *description, const char *unit, const char *names);

/* A sentence where `total` is 0; else `done` of `total` parts of the step of this name. */
typedef void (*attrito_listener)(const char *text, int done, int total);

/* So many bytes were asked for in vain; what is called may end the process. */
typedef void (*attrito_exhausted_callback)(long bytes);

typedef struct {
    int tangents;
    int law;
    double tangential_stiffness;
    double normal_stiffness;
    double friction_coefficient;
    double gap;
    double preload;
    int count;
    void *numbers;
} attrito_contact_law;

typedef struct {
    int harmonics;
    int samples;
    int rounds;
    int max_iterations;
    int reset_slider;
    int uncoupled;
    int choose_harmonics;
    int integrate_in_time;
    double tolerance;
    double accepted_error;
    double mode_error;
    double curve_tolerance;
} attrito_solver_options;

typedef struct {
    int branch;
    int iterations;
    int linear_iterations;
    int outcome;
    int unique;
    int finished;
    int reached_stop;
    int states[4];
    int harmonics;
    int samples;
    int petsc_error;
    double frequency_hz;
    double level;
    double residual;
    double estimate;
    double error_harmonics;
    double error_samples;
    double error_modes;
    double work;
} attrito_point;

/* A session on a structure of m coordinates. */
void *attrito_create(int comm, int m, const double *mass, const double *stiffness, int damping_kind,
    double damping_value, void *damping);

/* A damping ratio of each mode of the stuck system, ascending in frequency, in place of one of all. */
void attrito_set_damping_ratios(void *handle, int m, const double *ratios);

/* Coriolis forces at the speed of rotation, G [m, m], -G^T = G: a row of C's is a column here. */
void attrito_set_gyroscopic(void *handle, int m, const double *gyroscopic);

/* Loads and monitors: static loads [static_count, m], harmonic load [coefficients, m], monitors [monitor_count, m]. */
void attrito_set_loads(void *handle, int static_count, const double *static_loads, int coefficients,
    const double *harmonic_load, int monitor_count, const double *monitors);

/* Contacts and their rows of B [rows, m], each contact's tangents before its normal. */
void attrito_set_contacts(void *handle, int count, const attrito_contact_law *laws, int rows,
    const double *directions);

/* The model is one of N equal sectors, q_{j+1}(t) = q_j(t - EO T / N): its boundaries, what it has on the axis, and its contacts'
 * rows on the next sector [rows, m], after those on its own. */
void attrito_set_sector(void *handle, int sectors, int engine_order, int count, const int *lower, const int *upper,
    int number_along, const int *along, int pairs, const int *across, int rows, const double *next_directions);

/* Make the session ready to solve. */
int attrito_prepare(void *handle, const attrito_solver_options *options, char *message, int length);

/* Give the contacts other laws of the same stiffnesses and directions: modes stay. The static path is to be followed next. */
void attrito_change_laws(void *handle, int count, const attrito_contact_law *laws);

/* Follow the static load path [corners, static loads]; receptances are those of an angular frequency. */
int attrito_follow_static_path(void *handle, int loads, int corners, const double *path, int steps, double omega,
    attrito_point *point, char *message, int length);

/* Begin a sweep of the harmonic loads at a level between two angular frequencies. */
void attrito_begin_sweep(void *handle, double start, double stop, double level, int branch, int max_points);

/* Steps of the sweep that begins are parts of a wider range than its own, as of a sweep from within a band to one of its ends. */
void attrito_scale_sweep(void *handle, double low, double high);

/* The next point of the sweep. */
void attrito_next_point(void *handle, attrito_point *point);

/* A point at an angular frequency. */
void attrito_solve_at(void *handle, double omega, int branch, attrito_point *point);

/* A point at an angular frequency by one fallback strategy alone; the session's last point stays the one before, whether that
 * found a point or not. 0, or 1: there is no strategy of that name. */
int attrito_solve_by_strategy(void *handle, const char *strategy, double omega, attrito_point *point);

/* Coefficients of the monitors [monitors, 2 H + 1] and their amplitudes at the last point; how these change along a sweep there, 0
 * where that is not known. */
void attrito_monitors(void *handle, double *harmonics, double *amplitude, double *rate);

/* Which contacts the last static path has left closed: 1, or 0 [contacts]. */
void attrito_closed_contacts(void *handle, int *closed);

/* Start the libraries on all ranks that will ever use them together; where they run, nothing happens. Whatever solves on one rank
 * alone before all of them do asks for it. */
int attrito_start(int comm, char *message, int length);

/* The last call of a process, before MPI ends. */
void attrito_stop(void);

/* Give everything back. */
void attrito_destroy(void *handle);

/* Displacement and force [tangents + 1, instants] of one contact over a period, for its coefficients [tangents + 1, coefficients]
 * and sliders at its start [at least 2 elements]. */
void attrito_contact_at_instants(const attrito_contact_law *law, int coefficients, int instants, const double *motion,
    const double *slider, double *displacement, double *force);

/* Tangential force [samples] of one contact along a given path of displacement and normal force: `follow_path`. */
void attrito_follow_path(const attrito_contact_law *law, int samples, const double *displacement, const double *normal,
    int passes, double *force);

/* How many numbers the sliders of a contact take where contacts have these laws: a pair for each element. */
int attrito_slider_width(int count, const attrito_contact_law *laws);

/* Smallest and largest value over the period of trigonometric polynomials [count, coefficients]: [count] each. */
void attrito_extrema(int count, int coefficients, const double *polynomials, double *lowest, double *highest);

typedef struct {
    attrito_point point;
    double modal_amplitude;
    double excitation;
    double kinetic;
    double structural_ratio;
    double drift;
    int folded;
} attrito_backbone;

/* A mode from a shape with unit modal mass, cosine - i sine, and an angular frequency, at an amplitude of the shape; other shapes
 * of that frequency follow the first, [m, shapes] all together. The static path has been followed; the session serves nothing but
 * this mode from then on. */
void attrito_begin_mode(void *handle, int shapes, const double *cosine, const double *sine, double omega,
    double amplitude, int branch, attrito_backbone *backbone);

/* Ready for a mode, as `attrito_begin_mode` begins one, to go on from a state that was saved. */
void attrito_prepare_mode(void *handle, int shapes, const double *cosine, const double *sine, double omega);

/* Followed to another amplitude. */
void attrito_backbone_at(void *handle, double amplitude, int branch, attrito_backbone *backbone);

/* Relative error of the last point by harmonics, of frequency, negative damping or monitors, whichever is the largest; NaN if it
 * is not known. */
void attrito_mode_errors(void *handle, double *harmonics);

typedef struct {
    int kind;
    double frequency_hz;
    double uncertain_hz;
    double re;
    double im;
} attrito_bifurcation_report;

/* Find the bifurcations of the sweep's last step, in its order, and how many there are; the sweep goes on as if nothing had
 * been asked. What stands of the last point must have been written. Crossings are those of the engines and the orbit that the
 * last two points were examined by, if they were. */
int attrito_find_bifurcations(void *handle, int methods, int orbit);

/* One of those found, from 0, and the amplitudes of the monitors there. */
void attrito_bifurcation(void *handle, int i, attrito_bifurcation_report *report, double *amplitude);

/* Add the last point to those that are known; `follows`: the branch goes on from the one added before. */
void attrito_keep_point(void *handle, int follows);

/* Remove all known points but the first so many. */
void attrito_remove_points(void *handle, int count);

/* Make a known point the last one, from 0. */
void attrito_start_from_point(void *handle, int number);

/* Does the last point lie on a branch of the first so many points that are known? */
int attrito_lies_on_branch(void *handle, int count);

/* Look for a point at an angular frequency: 1 if one was found, on which the session then stands. */
int attrito_seek(void *handle, int way, double omega, double factor);

/* Begin a sweep along the branch on which the session stands, within a range of angular frequency: towards growing (1) or falling
 * (-1) frequency, or (0) back from where the last sweep stands. */
void attrito_begin_branch(void *handle, double start, double stop, int way, int branch, int max_points);

/* Stand at a motion of the model's coordinates [m, coefficients] at an angular frequency, with sliders [contacts, width], and
 * solve there; 1 if that converges. */
int attrito_start_from_motion(void *handle, int coefficients, const double *coordinates, const double *slider,
    double omega, double level);

/* Describe the interface in words, a line each: `names OF name=number ...` of an enumeration, `size OF bytes` of a structure,
 * `row OF cell | cell ...` of a table that documentation shows.
 * Returns the room that the text takes with the null character at its end; what does not fit is left out. */
int attrito_describe(int length, char *text);

typedef struct {
    int size;
    int contacts;
    int rows;
    int statics;
    int coefficients;
    int monitors;
    int damping_kind;
    double damping_value;
    void *mass;
    void *stiffness;
    void *damping;
    void *gyroscopic;
    void *damping_ratios;
    void *laws;
    void *directions;
    void *static_loads;
    void *harmonic_load;
    void *monitor_rows;
} attrito_integrate_scene;

/* See `run_options_type` */
typedef struct {
    int scheme;
    int steps_per_period;
    int cycles;
    int fewest;
    int multiples;
    int samples;
    int whole_run;
    int static_knots;
    int harmonic_knots;
    double omega;
    double level;
    double dissipation;
    double tolerance;
    void *static_factors;
    void *static_profile;
    void *harmonic_profile;
} attrito_integrate_options;

/* See `orbit_type` */
typedef struct {
    int outcome;
    int reason;
    int period;
    int cycles;
    int events;
    int chatter;
    int samples;
    double defect;
    double contraction;
    double amplitude;
    double work;
    double damping;
    double seconds;
} attrito_integrate_report;

/* A session on a scene at rest, unloaded. */
int attrito_integrator_create(const attrito_integrate_scene *scene, void **handle, char *message, int length);

/* Start from the end of a static load path [corners, statics], followed from rest with given sliders [contacts, 2] (or null: 0). */
int attrito_integrator_start_static(void *handle, int statics, int corners, const double *path, int steps,
    void *slider, char *message, int length);

/* Start from a state in the scene's coordinates: displacement [m], velocity [m], sliders [contacts, 2]. */
void attrito_integrator_start(void *handle, int size_of_scene, const double *displacement, const double *velocity,
    const double *slider);

/* The state as it stands, after the start or the last run. */
void attrito_integrator_state(void *handle, int size_of_scene, double *displacement, double *velocity, double *slider);

/* How many contacts carry a normal force as it stands. */
int attrito_integrator_touching(void *handle);

/* Integrate until steady; the session then stands at the end of the run. */
int attrito_integrator_run(void *handle, const attrito_integrate_options *options, attrito_integrate_report *report,
    char *message, int length);

/* Measures of the recorded period: monitors [monitors, 3] mean, lowest, highest; mean force of rows [rows]; contacts
 * [contacts, 5] shares of stick, slip, open, smallest normal force, energy dissipated a period of the excitation. */
void attrito_integrator_measures(void *handle, double *monitors, double *forces, double *contacts);

/* Samples: seconds [samples], monitors [samples, monitors], displacement and force of rows [samples, rows], regimes
 * [samples, contacts]. */
void attrito_integrator_samples(void *handle, double *time, double *monitors, double *displacement, double *force,
    int *regime);

/* Give everything back. */
void attrito_integrator_destroy(void *handle);

/* Linear response of the monitors of a reference system (`attrito_describe`): amplitudes [monitors, count] at level 1, and the
 * lowest natural frequencies [frequencies] in Hz of that system, elastic modes alone; zeros where there are fewer. `rigid`: its
 * rigid-body modes. */
int attrito_linear_response(void *handle, int kind, int count, const double *omega, double *amplitude, int frequencies,
    double *natural_hz, int *rigid, char *message, int length);

/* The lowest modes of a reference system (`attrito_describe`), normalised by mass: natural frequencies in Hz, damping ratios by
 * the structure's own damping (0 of rigid-body modes) [count], shapes [count, m], and how many of them, the first, are rigid-body
 * modes. */
int attrito_linear_modes(void *handle, int kind, int count, double *natural_hz, double *damping_ratio, double *shapes,
    int *rigid, char *message, int length);

/* The lowest modes of a reference system (`attrito_describe`) of a sector at one nodal diameter, x^H M x = 1: natural frequencies
 * in Hz, damping ratios by the structure's own damping (0 of rigid-body modes) [count], shapes x = cosine - i sine in the sector's
 * coordinates [count, m], and how many of them, the first, are rigid-body modes. */
int attrito_diameter_modes(void *handle, int kind, int diameter, int count, double *natural_hz, double *damping_ratio,
    double *cosine, double *sine, int *rigid, char *message, int length);

/* Leave the contacts as they are at the point that was loaded, from its sliders [contacts, width] at the start of the period. */
void attrito_take_sliders(void *handle, const double *slider);

/* Begin at the last point. */
void attrito_enter_family(void *handle);

/* Leave the session as it was. */
void attrito_leave_family(void *handle);

/* Floating-point operations since the family was entered. */
double attrito_family_work(void *handle);

/* Remember the present member in a slot, 0 or 1. */
void attrito_keep_member(void *handle, int slot);

/* Go back to the one remembered there. */
void attrito_return_to_member(void *handle, int slot);

/* Move the sliders [contacts, width]; 1 if that gave a member, else 0 and nothing has changed. It is given up after so many
 * operations. */
int attrito_solve_member(void *handle, const double *slider, double most_work);

/* Go to an angular frequency, rad/s, from the present motion and sliders; 1 if that gave a point, else 0 and nothing has changed. */
int attrito_solve_member_at(void *handle, double omega);

/* The present member: forces [contacts, 3, 2 H + 1], monitors [monitors, 2 H + 1] with amplitudes, sliders [contacts, width] and
 * whether they are free (1.0 or 0.0). 0, or not: it cannot be evaluated. */
int attrito_describe_member(void *handle, double *force, double *monitors, double *amplitude, double *slider,
    double *free);

/* Change of the member described last with component `tangent` (from 0) of -k_t w of a contact (from 0); 0, or not: singular. */
int attrito_differentiate_member(void *handle, int contact, int tangent, double *force, double *monitors);

/* Have a procedure called where an allocation of the library fails, before the process ends with code 2. */
void attrito_when_exhausted(attrito_exhausted_callback procedure);

typedef struct {
    attrito_point point;
    double parameter;
    double amplitude;
    double slope;
    double curvature;
    double amplitude_error;
    double frequency_error;
    int evaluations;
    int ending;
    int at_corner;
} attrito_peak;

/* Find the peak of a monitor (from 0) at a level, near an angular frequency; sweeps go from start to stop. The static path has been
 * followed. `static_factors` [loads] are those at preload 1. */
void attrito_begin_peak(void *handle, int monitor, int measure, int loads, const double *static_factors, double omega,
    double start, double stop, double level, int branch, attrito_peak *peak);

/* The same near a motion of the model's coordinates [m, coefficients], at a level and a preload, sliders where they are. */
void attrito_begin_peak_near(void *handle, int monitor, int measure, int loads, const double *static_factors,
    double omega, double start, double stop, double level, double preload, int coefficients, const double *coordinates,
    int branch, attrito_peak *peak);

/* Motion of the model's coordinates at the last point [m, coefficients]. */
void attrito_coordinates(void *handle, int coefficients, double *coordinates);

/* Follow it in the level (0) or the preload (1) from here on. */
void attrito_follow_peak_in(void *handle, int parameter, int branch, attrito_peak *peak);

/* One step along the curve of peaks, or just to a value of the parameter, where it has finished. */
void attrito_next_peak(void *handle, double stop, int branch, attrito_peak *peak);

/* The peak at a value of the parameter, by as many steps as it takes. */
void attrito_peak_at(void *handle, double value, int branch, attrito_peak *peak);

/* Report the last point, series by series; names of monitors, one a line. Collective. */
void attrito_report_point(void *handle, const char *monitors, attrito_series_callback listener);

/* Outcome of the last point by all that has been found of it, see `attrito_output_findings`. */
int attrito_outcome(void *handle);

/* Of motion in time under the loads of the last point, which has no solution: its period in periods of the excitation, 0: none. */
void attrito_set_period_in_time(void *handle, int period);

/* Save what the last point leaves for the next on this rank; returns how many numbers that is. */
int attrito_save_state(void *handle);

/* The numbers that were saved last. */
void attrito_fetch_state(void *handle, double *numbers);

/* Load, in place of the last point, what was saved on as many ranks; 1 if it is of this session's kind, else 0. Collective. */
int attrito_load_state(void *handle, int count, const double *numbers);

typedef struct {
    attrito_point point;
    double load;
    double amplitude;
    double structural_ratio;
    double area;
    double work;
    double coarse_work;
    double masing_omega;
    double masing_ratio;
} attrito_quasi_static;

/* Load a mode's shape with unit modal mass [m] quasi-statically. The static path has been followed; the session serves nothing but
 * such cycles from then on. */
void attrito_begin_quasi_static(void *handle, const double *shape, double omega);

/* A closed cycle of an amplitude of the load, in so many steps, from the static solution. */
void attrito_quasi_static_at(void *handle, double load, int steps, int settling, int branch,
    attrito_quasi_static *cycle);

/* The amplitude Q of a cycle that is not reported, from the static solution. */
void attrito_try_quasi_static(void *handle, double load, int steps, int settling, double *amplitude, int *closed,
    int *iterations);

/* Work of each contact in the last cycle, at the root. */
void attrito_quasi_static_work(void *handle, double *work);

/* See `reduction_options_type` */
typedef struct {
    int modes;
    int block_size;
    int block_vectors;
    int check_inertia;
    double max_frequency_hz;
    double error_target;
    double top_frequency_hz;
    double tolerance;
    double memory_megabytes;
    char ordering[8];
    char out_of_core[4];
    char eigensolver[16];
    char condense[4];
} attrito_reduce_options;

/* See `reduction_report_type` */
typedef struct {
    int dofs;
    int coordinates;
    int boundary;
    int modes;
    int corrections;
    int condensed;
    int negative_pivots;
    int modes_below_shift;
    int mode_solves;
    int factor_megabytes;
    int factor_megabytes_out_of_core;
    int out_of_core;
    char ordering[8];
    double factor_flops;
    double analysis_seconds;
    double shift_hz;
    double mode_residual;
    double constraint_residual;
    double worst_error;
    double seconds[10];
    double megabytes[10];
} attrito_reduce_report;

/* Reduce model.h5 to rom.h5; collective. */
int attrito_reduce(int comm, const char *model_path, const char *rom_path, const char *folder, int boundary_count,
    const int *boundary, int n, int vector_count, const double *vectors, int recovered_count, const int *recovered,
    const attrito_reduce_options *options, attrito_listener listener, attrito_reduce_report *report, int length,
    char *message);

/* What parameters change, or derivatives of quantities by it, one after another */
typedef struct {
    int count;
    int columns;
    int loads;
    int harmonics;
    void *laws;
    void *static_factors;
    void *level;
    void *harmonic_factors;
    void *damping;
} attrito_rates;

/* What derivatives are asked for from now on. */
void attrito_ask_derivatives(void *handle, int quantities, const int *kinds, int width, const double *factors,
    int count, const attrito_contact_law *laws, int sliders, int damping);

/* Friction coefficients of all contacts times a factor, until 1 gives them back: a contact at the onset of slip sticks with a
 * little more friction, and slips with a little less. */
void attrito_scale_friction(void *handle, double factor);

/* Contacts at the onset of slip: those that rest with friction larger by a part of it, and slip with friction smaller by as much
 * [contacts]. 0, or not: the point cannot be evaluated. */
int attrito_find_onsets(void *handle, double margin, double *begins);

/* By the frequency, rad/s: derivatives of the quantities [quantities]. 0, or not: the equations are singular. */
int attrito_differentiate_by_frequency(void *handle, double *derivatives);

/* By parameters: derivatives of the quantities [quantities, parameters]. 0, or not: the equations are singular. */
int attrito_differentiate_directly(void *handle, const attrito_rates *rates, double *derivatives);

/* Of the quantities by everything. 0, or not: the equations are singular. */
int attrito_differentiate_by_adjoint(void *handle, const attrito_rates *gradients);

/* By parameters: derivatives of the frequency, rad/s, of the peak of a monitor's half range (from 0) at which the solver stands
 * [parameters]. 0, or not: the equations are singular. */
int attrito_differentiate_peak_frequency(void *handle, int monitor, const attrito_rates *rates, double *derivatives);

/* By parameters, of a mode where it stands, its amplitude Q = |w . q_1| held: derivatives of the angular frequency, of the negative
 * damping and of the structure's damping ratio [3, parameters], and of the quantities [quantities, parameters]. 0, or not: the
 * equations are singular. */
int attrito_differentiate_mode(void *handle, const attrito_rates *rates, const double *cosine, const double *sine,
    const double *own, double *mode, double *quantities);

typedef struct {
    int verdict;
    int monodromy;
    int hill;
    double distance;
    double change;
    double low;
    double high;
} attrito_examination_report;

/* Examine the last point on an orbit (0 the balance's, 1 the event-exact one near it, 2 where need be) by the sum of engines (1
 * monodromy, 2 Hill's problem), note the verdict in what is going to be written of it,
 * and say why where there is none. */
int attrito_examine(void *handle, int methods, int orbit, int equivalent_viscous, attrito_examination_report *report,
    char *message, int length);

/* Multipliers of the last examination by one engine, 1 or 2: real and imaginary parts, kinds. */
void attrito_multipliers(void *handle, int method, double *re, double *im, int *kind);

/* Wavenumbers of the same multipliers, of a sector's wheel; -1: none. */
void attrito_wavenumbers(void *handle, int method, int *wavenumber);

/* Table of numbers [fields, lines] from lines of text, NaN where a field is empty; returns the first line, from 1, that
 * does not hold numbers, or 0. Widths of zero: fields are separated by blanks or commas. */
int attrito_read_numbers(const char *text, int lines, const long *first, const long *last, int fields,
    const int *begin, const int *width, double *table);

/* Whole numbers above zero [fields, lines] and, last in each line, a value [lines]; returns the first line, from 1, that holds
 * anything else, or 0. */
int attrito_read_entries(const char *text, int lines, const long *first, const long *last, int fields, int *whole,
    double *values);

#ifdef __cplusplus
}
#endif

#endif
