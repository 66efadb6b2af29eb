/* The extension module of the twin: Python objects in, C pointers out, no arithmetic.
 *
 * A function takes numbers, arrays and named tuples of them, which module_fields.c describes: the
 * fields of a struct are read from the attributes of the same names. All arrays are checked at each
 * call, before anything is computed: type, order in memory, and shape, where an axis of one name
 * has one length in all arguments. The GIL is kept: a step takes microseconds. */
#include "../../kernel/arrays.h"

#include "steps.c"

#include "module_fields.c"

/* What a call has read so far. */
typedef struct {
    array arrays[MAX_ARRAYS];
    size_t n_arrays;
    Py_ssize_t lengths[N_AXES + 1]; /* by name of the axis; -1 until it was seen */
} call;

/* Each of these calls a step, and fills the numbers that it returns. */

static void run_distances(arguments *a, double *Py_UNUSED(out))
{
    distances(a->solid, a->points, a->n, a->out);
}

static void run_probe(arguments *a, double *out)
{
    *(nearest *)out = probe(a->solid, a->point);
}

static void run_relief(arguments *a, double *out)
{
    *out = relief(a->solid, a->point);
}

static void run_touch(arguments *a, double *Py_UNUSED(out))
{
    touch(&a->physics.contact, &a->physics.constants, a->bodies, a->period);
}

static void run_fill_bodies(arguments *a, double *Py_UNUSED(out))
{
    fill_bodies(&a->physics.arrays, (body *)a->bodies);
}

static void run_apply_forces(arguments *a, double *Py_UNUSED(out))
{
    apply_forces(&a->physics.arrays, (const tip *)a->tips, a->total, a->bodies);
}

static void run_on_object(arguments *a, double *out)
{
    *(wrench *)out =
        on_object(a->fingers, a->outside, a->body, *a->inertia, a->mass, *a->spin, *a->turn);
}

static void run_control(arguments *a, double *Py_UNUSED(out))
{
    control(&a->physics.controller, a->tick, a->joints, a->bias, a->target, a->period, a->torques);
}

static void run_fill_targets(arguments *a, double *Py_UNUSED(out))
{
    fill_targets(a->grid, a->n, a->path, a->first, a->depths, a->m, a->out);
}

static void run_tremor_at(arguments *a, double *out)
{
    *(motion *)out = tremor_at(a->tremor, a->time, (size_t)a->step);
}

static void run_aim(arguments *a, double *out)
{
    *(motion *)out = aim(a->style, a->depth, a->rate, a->elapsed, a->duration);
}

static void run_hold_wrench(arguments *a, double *out)
{
    *(wrench *)out =
        hold_wrench(a->body, a->anchor, a->gain, a->weight, a->tremor, a->rms, a->time);
}

static void run_guide_wrench(arguments *a, double *out)
{
    *(wrench *)out = guide_wrench(a->body, a->guide, a->ahead, a->tremor, a->time);
}

static void run_disturb_wrench(arguments *a, double *out)
{
    *(wrench *)out = disturb_wrench(
        a->body, a->anchor, a->parameters, a->style, a->duration, a->tremor, a->rms, a->elapsed);
}

static bool succeeds(PyObject *half_step)
{
    PyObject *const result = PyObject_CallNoArgs(half_step);
    Py_XDECREF(result);
    return result != NULL;
}

/* Advance the physics by a sample; a half step that fails leaves its exception. MuJoCo's write no
 * number that was checked. */
static void run_advance_sample(arguments *a, double *out)
{
    const physics *const p = &a->physics;
    double time = a->action.time;
    *out = 0.0;
    for (int64_t k = 0; k < p->n_steps && succeeds(a->first_half); ++k) {
        *out = larger(*out, apply_all(p, a->tick, k, a->target, &a->action, time));
        if (!succeeds(a->second_half)) {
            return;
        }
        time += p->period; /* as MuJoCo adds it */
    }
}

static void run_saturated(arguments *a, double *out)
{
    *out = saturated(a->newtons, a->limit);
}

static void run_read_out(arguments *a, double *Py_UNUSED(out))
{
    read_out(a->forces, a->times, a->drawn, a->n, &a->constants, &a->state, a->counts);
}

/* A function of the module. */
typedef struct {
    PyMethodDef method; /* not const: so Python takes it */
    const field *fields;
    void (*run)(arguments *, double *);
    const char *results; /* format of Py_BuildValue for at most six numbers */
} function;

/* Read an array and check its shape, or set an exception and return -1. */
static int read_array(call *c, const field *f, PyObject *value, void *target)
{
    Py_ssize_t expected[4];
    int n_axes = 0;
    if (c->n_arrays == MAX_ARRAYS) {
        PyErr_SetString(PyExc_SystemError, "MAX_ARRAYS is too small");
        return -1;
    }
    array *const a = &c->arrays[c->n_arrays];
    while (n_axes < 4 && f->axes[n_axes] != 0) {
        ++n_axes;
    }
    c->n_arrays += 1; /* it is released with the others, whatever happens */
    const int flags = f->is_out ? PyBUF_WRITABLE : PyBUF_SIMPLE;
    if (get_array(f->format, value, f->name, n_axes, flags, a) < 0) {
        return -1;
    }
    for (int axis = 0; axis < n_axes; ++axis) {
        const int length = f->axes[axis];
        Py_ssize_t *const seen = length < 0 ? &c->lengths[-length] : &(Py_ssize_t){length};
        if (*seen < 0) {
            *seen = a->view.shape[axis];
            if (*seen == 0 && length != N_SAMPLES && length != N_POINTS) {
                PyErr_Format(PyExc_ValueError, "%s: axis %d has the length 0", f->name, axis);
                return -1;
            }
        }
        expected[axis] = *seen;
    }
    memcpy(target, &a->view.buf, sizeof a->view.buf);
    return check_shape(a, expected);
}

/* Read fields from the attributes of an object, or, if it is NULL, from arguments; or set an
 * exception and return -1. */
static int read_fields(
    call *c, const field *fields, PyObject *object, PyObject *const *args, char *target);

static int read_field(call *c, const field *f, PyObject *value, void *target)
{
    if (f->kind == AN_ARRAY) {
        return read_array(c, f, value, target);
    }
    if (f->kind == A_STRUCT) {
        return read_fields(c, f->fields, value, NULL, target);
    }
    if (f->kind == A_CALLABLE) {
        *(PyObject **)target = value; /* the caller keeps it */
    } else if (f->kind == A_REAL) {
        *(double *)target = PyFloat_AsDouble(value);
    } else {
        *(int64_t *)target = PyLong_AsLongLong(value);
    }
    return PyErr_Occurred() ? -1 : 0;
}

static int read_fields(
    call *c, const field *fields, PyObject *object, PyObject *const *args, char *target)
{
    for (const field *f = fields; f->name != NULL; ++f) {
        if (f->kind == A_LENGTH) {
            *(size_t *)(target + f->offset) = (size_t)c->lengths[-f->axes[0]];
            continue;
        }
        PyObject *const value =
            object == NULL ? Py_NewRef(*args++) : PyObject_GetAttrString(object, f->name);
        const int result = value == NULL ? -1 : read_field(c, f, value, target + f->offset);
        Py_XDECREF(value); /* its buffer, if any, keeps it */
        if (result < 0) {
            return -1;
        }
    }
    return 0;
}

/* Return what is wrong with the numbers by which steps index or divide; NULL if they fit. */
static const char *wrong_numbers(const call *c, const function *f, const arguments *a)
{
    const physics *const p = &a->physics;
    const hand *const h = &p->arrays;
    const int64_t most = INT64_MAX / 2; /* so that no sum overflows */
    if (c->lengths[-N_TIPS] >= 0 && c->lengths[-N_BODIES] >= 0 &&
        c->lengths[-N_BODIES] != c->lengths[-N_TIPS] + 1) {
        return "bodies: a row for each fingertip and one for the object expected";
    }
    for (size_t i = 0; h->tips != NULL && i <= h->n_tips; ++i) {
        const int64_t body = i < h->n_tips ? h->tips[i] : h->object_body;
        if (body < 0 || (size_t)body >= h->n_model || h->roots[body] < 0 ||
            (size_t)h->roots[body] >= h->n_model) {
            return "tips, object_body, roots: a body that the model does not have";
        }
    }
    for (int axis = N_QPOS; a->target != NULL && axis <= N_TORQUES; ++axis) {
        if (c->lengths[-axis] >= 0 && c->lengths[-axis] < N_JOINTS) {
            return "joints, bias or torques: at least 16 numbers expected";
        }
    }
    for (size_t i = 0; a->first != NULL && i < a->m; ++i) {
        if (a->first[i] < 0 || a->first[i] > N_JOINTS - JOINTS_OF_FINGER || a->n < 2) {
            return "first, grid: joints of the hand and two points of a path expected";
        }
    }
    const constants *const k = &p->constants;
    if (k->skin != NULL && k->skin->shear_modulus > 0.0 &&
        (k->n_coupled != k->n_nodes || k->n_nodes > MAX_COUPLED)) {
        return "nearness: a row for each node expected, and at most 1024 coupled nodes";
    }
    if (a->tick < 0 || a->tick > most || a->step < 0 || a->step > 2 || p->n_steps < 0 ||
        p->n_steps > most || (f->run == run_advance_sample && p->per_control < 1)) {
        return "a number of a step or an axis is out of range";
    }
    if (f->run == run_read_out &&
        (a->constants.line < 1 || c->lengths[-N_DRAWN] != 1 + 3 * c->lengths[-N_TAXELS])) {
        return "line: at least 1 expected; drawn: 1 + 3 numbers for each taxel";
    }
    return NULL;
}

/* Call a function of the table, which is in the capsule. */
static PyObject *run(PyObject *capsule, PyObject *const *args, Py_ssize_t n_args)
{
    const function *const f = PyCapsule_GetPointer(capsule, NULL);
    arguments a = {0};
    call c = {0};
    memset(c.lengths, -1, sizeof c.lengths);
    PyObject *result = NULL;
    double x[6] = {0};
    Py_ssize_t n = 0;
    for (const field *argument = f->fields; argument->name != NULL; ++argument) {
        n += argument->kind != A_LENGTH;
    }
    if (n != n_args) {
        return PyErr_Format(
            PyExc_TypeError, "%s: %zd arguments expected, %zd given", f->method.ml_name, n, n_args);
    }
    if (read_fields(&c, f->fields, NULL, args, (char *)&a) == 0) {
        const char *const wrong = wrong_numbers(&c, f, &a);
        if (wrong != NULL) {
            PyErr_SetString(PyExc_ValueError, wrong);
        } else {
            f->run(&a, x);
            result = PyErr_Occurred()
                         ? NULL
                         : Py_BuildValue(f->results, x[0], x[1], x[2], x[3], x[4], x[5]);
        }
    }
    release(c.arrays, c.n_arrays);
    return result;
}

/* clang-format off */
#define METHOD(name) {name, (PyCFunction)(void (*)(void))run, METH_FASTCALL, NULL}
/* clang-format on */
static function functions[] = {
    {METHOD("distances"), distances_arguments, run_distances, ""},
    {METHOD("probe"), probe_arguments, run_probe, "dddd"},
    {METHOD("relief"), probe_arguments, run_relief, "d"},
    {METHOD("touch"), touch_arguments, run_touch, ""},
    {METHOD("fill_bodies"), fill_bodies_arguments, run_fill_bodies, ""},
    {METHOD("apply_forces"), apply_forces_arguments, run_apply_forces, ""},
    {METHOD("on_object"), on_object_arguments, run_on_object, "dddddd"},
    {METHOD("control"), control_arguments, run_control, ""},
    {METHOD("fill_targets"), fill_targets_arguments, run_fill_targets, ""},
    {METHOD("tremor_at"), tremor_at_arguments, run_tremor_at, "dd"},
    {METHOD("aim"), aim_arguments, run_aim, "dd"},
    {METHOD("hold_wrench"), hold_wrench_arguments, run_hold_wrench, "dddddd"},
    {METHOD("guide_wrench"), guide_wrench_arguments, run_guide_wrench, "dddddd"},
    {METHOD("disturb_wrench"), disturb_wrench_arguments, run_disturb_wrench, "dddddd"},
    {METHOD("advance_sample"), advance_sample_arguments, run_advance_sample, "d"},
    {METHOD("saturated"), saturated_arguments, run_saturated, "d"},
    {METHOD("read_out"), read_out_arguments, run_read_out, ""},
};

/* Columns of arrays, and other whole numbers of the C files that Python uses too. */
#define COLUMN(type, member) ((long)(offsetof(type, member) / sizeof(double)))
/* clang-format off */
static const struct {const char *name; long value;} whole_numbers[] = {
    {"REVOLVED", REVOLVED}, {"BOX", BOX}, {"HEXAGON", HEXAGON}, {"CAPSULE", CAPSULE},
    {"CODE", COLUMN(solid, code)}, {"SIDE_OUT", COLUMN(solid, side_out)},
    {"SIDE_UP", COLUMN(solid, side_up)}, {"SIDE_LENGTH", COLUMN(solid, side_length)},
    {"EXTENSION", COLUMN(solid, extension)}, {"CENTRE", COLUMN(solid, centre)},
    {"TEXTURE_AMPLITUDE", COLUMN(solid, texture_amplitude)}, {"AROUND_2", COLUMN(solid, around_2)},
    {"MAX_COUPLED", MAX_COUPLED}, {"MU_STATIC", COLUMN(solid, mu_static)}, {"MU_KINETIC", COLUMN(solid, mu_kinetic)},
    {"N_OBJECT_NUMBERS", N_NUMBERS(solid)}, {"N_BRISTLE", N_NUMBERS(bristle)},
    {"TIP_SLIP", COLUMN(tip, slip)}, {"TIP_SLIPPING_SHARE", COLUMN(tip, slipping_share)},
    {"TIP_LOAD", COLUMN(tip, load)}, {"N_TIP", N_NUMBERS(tip)},
    {"GUIDE_STIFFNESS", COLUMN(guide, stiffness)}, {"N_GUIDE", N_NUMBERS(guide)}, {"PUSH", PUSH},
    {"JERK", JERK}, {"SHAKE", SHAKE}, {"MOVE", MOVE},
};

static const struct {const char *name; double value;} real_numbers[] = {
    {"MAX_RELIEF", MAX_RELIEF}, {"DERIVATIVE", DERIVATIVE}, {"ENCODER_STEP", ENCODER_STEP},
    {"TORQUE_STEP", TORQUE_STEP}, {"TORQUE_LIMIT", TORQUE_LIMIT},
    {"HOLD_STIFFNESS", HOLD_STIFFNESS}, {"HOLD_TURN_STIFFNESS", HOLD_TURN_STIFFNESS},
    {"PUSH_LIMIT", PUSH_LIMIT}, {"PUSH_GAP", PUSH_GAP}, {"MOVE_GRASP_TIME", MOVE_GRASP_TIME},
};
/* clang-format on */

/* Add an object, whose reference is taken, or return -1. */
static int add_object(PyObject *module, const char *name, PyObject *object)
{
    const int result = PyModule_AddObjectRef(module, name, object); /* fails for NULL */
    Py_XDECREF(object);
    return result;
}

#define N_OF(table) (sizeof(table) / sizeof((table)[0]))

static int add_contents(PyObject *module)
{
    int result = PyModule_AddStringConstant(module, "SOURCES", HOLDFAST_SOURCES);
    for (size_t i = 0; result == 0 && i < N_OF(functions); ++i) {
        PyMethodDef *const method = &functions[i].method;
        PyObject *const capsule = PyCapsule_New(&functions[i], NULL, NULL);
        PyObject *const made = capsule == NULL ? NULL : PyCFunction_New(method, capsule);
        Py_XDECREF(capsule);
        result = add_object(module, method->ml_name, made);
    }
    for (size_t i = 0; result == 0 && i < N_OF(whole_numbers); ++i) {
        result = PyModule_AddIntConstant(module, whole_numbers[i].name, whole_numbers[i].value);
    }
    for (size_t i = 0; result == 0 && i < N_OF(real_numbers); ++i) {
        PyObject *const number = PyFloat_FromDouble(real_numbers[i].value);
        result = add_object(module, real_numbers[i].name, number);
    }
    return result;
}

static PyModuleDef_Slot module_slots[] = {
    {Py_mod_exec, SLOT(add_contents)},
    {0, NULL},
};

static struct PyModuleDef module_definition = {
    PyModuleDef_HEAD_INIT, "steps", NULL, 0, NULL, module_slots, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit_steps(void)
{
    return PyModuleDef_Init(&module_definition);
}
