/* The fields of all structs and the arguments of all functions of the extension: a part of
 * module.c, which includes it. One line here is all that a field needs beside its struct. */

/* clang-format off */

/* Names of axes that are not of a fixed length; the others are positive. */
enum {
    N_TIPS = -17,
    N_BODIES, /* of the contact: fingertips and the object */
    N_NODES,
    N_COUPLED, /* N_NODES if nodes are coupled, else 1 */
    N_MODEL, /* bodies in MuJoCo */
    N_QPOS,
    N_DOF,
    N_TORQUES,
    N_SINUSOIDS,
    N_ERRORS,
    N_NOISE,
    N_TAXELS,
    N_LAGS,
    N_AVERAGED,
    N_DRAWN,  /* 1 + 3 N_TAXELS */
    N_POINTS, /* this and the next may be 0 */
    N_SAMPLES,
};
enum { N_AXES = -N_TIPS, MAX_ARRAYS = 48 };

typedef enum { AN_ARRAY, A_REAL, A_WHOLE, A_LENGTH, A_STRUCT, A_CALLABLE } kind;

/* A field of a struct, or an argument of a function. */
typedef struct field {
    const char *name;
    kind kind;
    size_t offset;
    int axes[4];          /* of an array: lengths or names, then 0; of a length: its name */
    char format;          /* of an array */
    bool is_out;          /* an array that is written */
    const struct field *fields; /* of a struct */
} field;

#define ARRAY(type, member, letter, out, ...) \
    {.name = #member, .kind = AN_ARRAY, .offset = offsetof(type, member), .format = letter, \
     .is_out = out, .axes = {__VA_ARGS__}}
#define IN(type, member, ...) ARRAY(type, member, 'd', false, __VA_ARGS__)
#define OUT(type, member, ...) ARRAY(type, member, 'd', true, __VA_ARGS__)
#define REAL(type, member) {.name = #member, .kind = A_REAL, .offset = offsetof(type, member)}
#define WHOLE(type, member) {.name = #member, .kind = A_WHOLE, .offset = offsetof(type, member)}
#define LENGTH(type, member, axis) \
    {.name = #member, .kind = A_LENGTH, .offset = offsetof(type, member), .axes = {axis}}
#define STRUCT(type, member, table) \
    {.name = #member, .kind = A_STRUCT, .offset = offsetof(type, member), .fields = table}
#define N_NUMBERS(type) ((int)(sizeof(type) / sizeof(double)))

static const field constants_fields[] = {
    IN(constants, nodes, N_NODES, N_NUMBERS(node)), IN(constants, solid, N_NUMBERS(solid)),
    IN(constants, skin, N_NUMBERS(skin)), IN(constants, nearness, N_COUPLED, N_COUPLED),
    LENGTH(constants, n_nodes, N_NODES), LENGTH(constants, n_coupled, N_COUPLED), {0},
};

static const field contact_fields[] = {
    OUT(contact, bristles, N_TIPS, N_NODES, N_NUMBERS(bristle)),
    OUT(contact, node_forces, N_TIPS, N_NODES, 3), OUT(contact, tips, N_TIPS, N_NUMBERS(tip)),
    OUT(contact, wrench, 6), LENGTH(contact, n_tips, N_TIPS), {0},
};

static const field hand_fields[] = {
    IN(hand, xpos, N_MODEL, 3), IN(hand, xmat, N_MODEL, 9), IN(hand, xipos, N_MODEL, 3),
    IN(hand, ximat, N_MODEL, 9), IN(hand, cvel, N_MODEL, 6), IN(hand, subtree_com, N_MODEL, 3),
    IN(hand, qpos, N_QPOS), IN(hand, qfrc_bias, N_DOF), OUT(hand, qfrc_applied, N_DOF),
    OUT(hand, xfrc_applied, N_MODEL, 6), ARRAY(hand, roots, 'i', false, N_MODEL),
    ARRAY(hand, tips, 'i', false, N_TIPS), IN(hand, mounts, N_TIPS, 3), WHOLE(hand, object_body),
    LENGTH(hand, n_tips, N_TIPS), LENGTH(hand, n_model, N_MODEL), {0},
};

static const field controller_fields[] = {
    IN(controller, gains, N_JOINTS), IN(controller, compensation, N_JOINTS),
    IN(controller, noise, N_NOISE, N_JOINTS), IN(controller, errors, N_ERRORS, N_JOINTS),
    OUT(controller, last, N_JOINTS), OUT(controller, published, N_JOINTS),
    OUT(controller, geared, N_JOINTS), REAL(controller, backlash),
    LENGTH(controller, n_noise, N_NOISE), LENGTH(controller, n_errors, N_ERRORS), {0},
};

static const field action_fields[] = {
    IN(action, anchor, N_NUMBERS(pose)), REAL(action, hold), REAL(action, weight),
    IN(action, tremors, 2, 3, N_SINUSOIDS, 3), REAL(action, rms), REAL(action, time),
    IN(action, parameters, N_NUMBERS(disturbance)), IN(action, origin, N_NUMBERS(pose)),
    WHOLE(action, style), REAL(action, duration), REAL(action, elapsed), IN(action, pull, 6),
    IN(action, guide, N_NUMBERS(guide)), LENGTH(action, n_sinusoids, N_SINUSOIDS), {0},
};

static const field physics_fields[] = {
    STRUCT(physics, arrays, hand_fields), STRUCT(physics, contact, contact_fields),
    STRUCT(physics, constants, constants_fields), STRUCT(physics, controller, controller_fields),
    OUT(physics, bodies, N_BODIES, N_NUMBERS(body)), OUT(physics, outside, 6),
    OUT(physics, total, 6), WHOLE(physics, n_steps), REAL(physics, period),
    WHOLE(physics, per_control), {0},
};

static const field taxels_fields[] = {
    IN(taxels, mixing, N_TAXELS, 3, 3), IN(taxels, baseline, N_TAXELS, 3),
    IN(taxels, thermal, N_TAXELS, 3), IN(taxels, noise, N_TAXELS), {0},
};

static const field readout_constants_fields[] = {
    STRUCT(readout_constants, taxels, taxels_fields), IN(readout_constants, limits, 3),
    IN(readout_constants, scales, 3), IN(readout_constants, shares, N_LAGS),
    IN(readout_constants, taus, N_LAGS), REAL(readout_constants, prompt),
    IN(readout_constants, noise, 3), REAL(readout_constants, scan),
    WHOLE(readout_constants, line), REAL(readout_constants, step),
    REAL(readout_constants, spread), REAL(readout_constants, thermal_time), {0},
};

static const field readout_state_fields[] = {
    OUT(readout_state, force, N_TAXELS, 3), OUT(readout_state, delayed, N_LAGS, N_TAXELS, 3),
    OUT(readout_state, numbers, 3), OUT(readout_state, passed, N_TAXELS, 3),
    OUT(readout_state, passed_now, N_TAXELS, 3),
    OUT(readout_state, readings, N_AVERAGED, N_TAXELS, 3),
    ARRAY(readout_state, n_read, 'i', true, N_TAXELS),
    ARRAY(readout_state, shown, 'H', true, N_TAXELS, 3),
    LENGTH(readout_state, n_taxels, N_TAXELS), LENGTH(readout_state, n_lags, N_LAGS),
    LENGTH(readout_state, n_averaged, N_AVERAGED), {0},
};

/* The arguments of the functions. */
typedef struct {
    PyObject *first_half, *second_half;
    physics physics;
    action action;
    readout_constants constants;
    readout_state state;
    const double *tips, *target, *joints, *bias, *times, *drawn, *grid, *path, *depths;
    const int *first;
    double *out, *torques;
    uint16_t *counts;
    const body *bodies, *body;
    const pose *anchor;
    const guide *guide;
    const disturbance *parameters;
    const solid *solid;
    const vec *inertia, *spin, *turn, *points, *forces;
    const wrench *fingers, *outside, *total;
    tremor tremor;
    vec point;
    int64_t tick, step, style;
    double time, period, gain, weight, mass, rms, elapsed, duration, depth, rate, ahead;
    double newtons, limit;
    size_t n, m;
} arguments;

#define NUMBER(member) REAL(arguments, member)
#define CALLABLE(member) \
    {.name = #member, .kind = A_CALLABLE, .offset = offsetof(arguments, member)}
#define TREMOR \
    {.name = "tremor", .kind = AN_ARRAY, .offset = offsetof(arguments, tremor.sinusoids), \
     .format = 'd', .axes = {3, N_SINUSOIDS, 3}}, LENGTH(arguments, tremor.n, N_SINUSOIDS)
#define OBJECT IN(arguments, body, N_NUMBERS(body))
#define HAND STRUCT(arguments, physics.arrays, hand_fields)
#define CONTACT STRUCT(arguments, physics.contact, contact_fields)
#define CONSTANTS STRUCT(arguments, physics.constants, constants_fields)
#define CONTROLLER STRUCT(arguments, physics.controller, controller_fields)
#define BODIES IN(arguments, bodies, N_BODIES, N_NUMBERS(body))
#define TARGET IN(arguments, target, N_JOINTS)
#define SOLID IN(arguments, solid, N_NUMBERS(solid))
#define POINT NUMBER(point.x), NUMBER(point.y), NUMBER(point.z)

static const field distances_arguments[] = {
    SOLID, IN(arguments, points, N_POINTS, 3), OUT(arguments, out, N_POINTS),
    LENGTH(arguments, n, N_POINTS), {0},
};
static const field probe_arguments[] = {SOLID, POINT, {0}};
static const field touch_arguments[] = {CONTACT, CONSTANTS, BODIES, NUMBER(period), {0}};
static const field fill_bodies_arguments[] = {
    HAND, OUT(arguments, bodies, N_BODIES, N_NUMBERS(body)), {0},
};
static const field apply_forces_arguments[] = {
    HAND, IN(arguments, tips, N_TIPS, N_NUMBERS(tip)), IN(arguments, total, 6), BODIES, {0},
};
static const field on_object_arguments[] = {
    IN(arguments, fingers, 6), IN(arguments, outside, 6), OBJECT, IN(arguments, inertia, 3),
    NUMBER(mass), IN(arguments, spin, 3), IN(arguments, turn, 3), {0},
};
static const field fill_targets_arguments[] = {
    IN(arguments, grid, N_POINTS), IN(arguments, path, N_TIPS, N_POINTS, JOINTS_OF_FINGER),
    ARRAY(arguments, first, 'i', false, N_TIPS), IN(arguments, depths, N_TIPS),
    OUT(arguments, out, N_JOINTS), LENGTH(arguments, n, N_POINTS), LENGTH(arguments, m, N_TIPS),
    {0},
};
static const field control_arguments[] = {
    CONTROLLER, WHOLE(arguments, tick), IN(arguments, joints, N_QPOS), IN(arguments, bias, N_DOF),
    TARGET, NUMBER(period), OUT(arguments, torques, N_TORQUES),
    {0},
};
static const field tremor_at_arguments[] = {TREMOR, NUMBER(time), WHOLE(arguments, step), {0}};
static const field aim_arguments[] = {
    WHOLE(arguments, style), NUMBER(depth), NUMBER(rate), NUMBER(elapsed), NUMBER(duration), {0},
};
static const field hold_wrench_arguments[] = {
    OBJECT, IN(arguments, anchor, N_NUMBERS(pose)), NUMBER(gain), NUMBER(weight), TREMOR,
    NUMBER(rms), NUMBER(time), {0},
};
static const field guide_wrench_arguments[] = {
    OBJECT, IN(arguments, guide, N_NUMBERS(guide)), NUMBER(ahead), TREMOR, NUMBER(time), {0},
};
static const field disturb_wrench_arguments[] = {
    OBJECT, IN(arguments, anchor, N_NUMBERS(pose)),
    IN(arguments, parameters, N_NUMBERS(disturbance)), WHOLE(arguments, style), NUMBER(duration),
    TREMOR, NUMBER(rms), NUMBER(elapsed), {0},
};
static const field advance_sample_arguments[] = {
    CALLABLE(first_half), CALLABLE(second_half), STRUCT(arguments, physics, physics_fields),
    WHOLE(arguments, tick), TARGET, STRUCT(arguments, action, action_fields), {0},
};
static const field saturated_arguments[] = {NUMBER(newtons), NUMBER(limit), {0}};
static const field read_out_arguments[] = {
    IN(arguments, forces, N_SAMPLES, N_TAXELS, 3), IN(arguments, times, N_SAMPLES),
    IN(arguments, drawn, N_SAMPLES, N_DRAWN),
    STRUCT(arguments, constants, readout_constants_fields),
    STRUCT(arguments, state, readout_state_fields),
    ARRAY(arguments, counts, 'H', true, N_SAMPLES, N_TAXELS, 3), LENGTH(arguments, n, N_SAMPLES),
    {0},
};
/* clang-format on */
