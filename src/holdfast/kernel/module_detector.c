/* The detector of the extension module: a part of module.c, which includes it.
 *
 * `Detector.update` copies the samples of a dictionary, processes them, and returns an estimate of
 * the hand. It keeps the GIL; `Detector.run` releases it. An estimate of a hand holds a copy of the
 * C structs of its fingers; the Python object of a finger is made when it is read. */

/* Python objects that a detector uses, which it reads by these names. */
enum {
    FINGER_INDICES, /* dictionary: index of each finger by its name */
    HAND_TYPE,      /* of the estimate of a hand */
    ESTIMATES_TYPE, /* of those of its fingers: a subclass of Estimates */
    CONTACT_TYPE,   /* of the estimate of a finger */
    STATES,         /* tuples, by code */
    REASONS,
    CAUSES,
    FAULTS_OF, /* functions of a mask */
    TAXELS_OF,
    ARRAY_TYPE, /* numpy.ndarray */
    NOTE,       /* is called with (time, states before, states after) at a change */
    N_OBJECTS
};
static const char *const object_names[N_OBJECTS] = {
    "fingers", "hand",      "estimates", "contact",    "states", "reasons",
    "causes",  "faults_of", "taxels_of", "array_type", "note",
};

/* A detector of a hand. It begins with a stream, whose constants and memory it uses. */
typedef struct {
    stream base;
    holdfast_model model;
    holdfast_detector_memory d;
    PyObject *rules; /* bytes, which `set_rules` replaces */
    PyObject *weights;
    double *readings;                    /* (n_taxels, 3) of one sample */
    holdfast_finger_estimate *estimates; /* (n_fingers) */
    char *before;                        /* (n_fingers + 1) states of fingers and hand */
    char *after;
    PyObject *objects[N_OBJECTS];
} detector;

/* Estimates of the fingers of a hand at one instant, by name. */
typedef struct {
    PyObject_VAR_HEAD detector *detector; /* that made them */
    holdfast_finger_estimate fingers[1];
} estimates;

/* Take the objects of an argument, or set an exception and return -1. */
static int read_objects(detector *s, PyObject *argument)
{
    for (size_t i = 0; i < N_OBJECTS; ++i) {
        s->objects[i] = PyObject_GetAttrString(argument, object_names[i]);
        if (s->objects[i] == NULL) {
            return -1;
        }
    }
    if (!PyDict_Check(s->objects[FINGER_INDICES]) || !PyTuple_Check(s->objects[STATES]) ||
        !PyTuple_Check(s->objects[REASONS]) || !PyTuple_Check(s->objects[CAUSES]) ||
        PyDict_Size(s->objects[FINGER_INDICES]) != (Py_ssize_t)s->base.hand.n_fingers) {
        PyErr_SetString(PyExc_ValueError, "objects of an estimate of these fingers expected");
        return -1;
    }
    return 0;
}

/* Replace the rules of a detector, or set an exception, return -1 and change nothing. */
static int set_rules(detector *s, PyObject *rules, PyObject *weights)
{
    holdfast_model model = s->model;
    if (!(model.rules = from_bytes(rules, "rules", model.hand->n_fingers, sizeof *model.rules)) ||
        !(model.weights = from_bytes(weights, "weights", model.n_weights, sizeof(double))) ||
        refuse_config(holdfast_check_model(&model)) < 0) {
        return -1;
    }
    PyObject *const old[] = {s->rules, s->weights};
    s->model = model;
    s->rules = Py_NewRef(rules);
    s->weights = Py_NewRef(weights);
    Py_XDECREF(old[0]);
    Py_XDECREF(old[1]);
    return 0;
}

/* Detector(the eight of a stream, model, rules, weights, objects) */
static PyObject *detector_new(PyTypeObject *type, PyObject *args, PyObject *names)
{
    enum { FIRST = N_STREAM_PARTS };
    PyObject *items[FIRST + 4];
    if (read_arguments(args, names, FIRST + 4, items) == NULL) {
        return NULL;
    }
    detector *const s = (detector *)PyType_GenericAlloc(type, 0); /* all bytes are 0 */
    if (s == NULL) {
        return NULL;
    }
    const void *model = NULL;
    if (begin_stream(&s->base, items, "detector") < 0 ||
        !(model = from_bytes(items[FIRST], "model", 1, sizeof s->model))) {
        goto failed;
    }
    memcpy(&s->model, model, sizeof s->model);
    s->model.hand = &s->base.hand;
    /* A number of weights that no memory has: their size must not overflow. */
    if (s->model.n_weights > PTRDIFF_MAX / sizeof(double)) {
        PyErr_SetString(PyExc_ValueError, "n_weights is too large");
        goto failed;
    }
    const size_t n = s->base.hand.n_fingers;
    if (set_rules(s, items[FIRST + 1], items[FIRST + 2]) < 0 ||
        read_objects(s, items[FIRST + 3]) < 0 ||
        !(s->readings = allocate(&s->base, 3 * s->base.n_taxels, sizeof(double))) ||
        !(s->estimates = allocate(&s->base, n, sizeof *s->estimates)) ||
        !(s->d.decisions = allocate(&s->base, n, sizeof *s->d.decisions)) ||
        !(s->before = allocate(&s->base, 2, n + 1))) {
        goto failed;
    }
    s->after = s->before + n + 1;
    s->d.memory = s->base.memory; /* its arrays, which have the baseline already */
    holdfast_start_decisions(&s->model, &s->d);
    return (PyObject *)s;
failed:
    Py_DECREF(s);
    return NULL;
}

static int detector_traverse(PyObject *self, visitproc visit, void *arg)
{
    Py_VISIT(Py_TYPE(self));
    for (size_t i = 0; i < N_OBJECTS; ++i) {
        Py_VISIT(((detector *)self)->objects[i]);
    }
    return 0;
}

static int detector_clear(PyObject *self)
{
    /* What can be part of a cycle; the methods of a detector that is cleared are not called. */
    Py_CLEAR(((detector *)self)->objects[NOTE]);
    return 0;
}

static void detector_dealloc(PyObject *self)
{
    detector *const s = (detector *)self;
    PyTypeObject *const type = Py_TYPE(self);
    PyObject_GC_UnTrack(self);
    for (size_t i = 0; i < N_OBJECTS; ++i) {
        Py_XDECREF(s->objects[i]);
    }
    Py_XDECREF(s->rules);
    Py_XDECREF(s->weights);
    free_stream(&s->base);
    PyObject_GC_Del(self);
    Py_DECREF(type);
}

/* Return a new reference to what a function makes of a mask. */
static PyObject *from_mask(PyObject *function, uint64_t mask)
{
    PyObject *const number = PyLong_FromUnsignedLongLong(mask);
    PyObject *const result = number ? PyObject_CallFunctionObjArgs(function, number, NULL) : NULL;
    Py_XDECREF(number);
    return result;
}

/* Return a number as a Python object; None if the model has no such head. */
static PyObject *number_of(const holdfast_head *head, double value)
{
    return head->n_outputs > 0 ? PyFloat_FromDouble(value) : Py_NewRef(Py_None);
}

static PyObject *make_finger(const estimates *e, size_t i)
{
    enum { N = 12 };
    PyObject *const *const objects = e->detector->objects;
    const holdfast_head *const heads = e->detector->model.rules[i].heads;
    const holdfast_head *const slip = &heads[HOLDFAST_HEAD_SLIP];
    const holdfast_head *const speed = &heads[HOLDFAST_HEAD_SPEED];
    const holdfast_finger_estimate *const f = &e->fingers[i];
    PyObject *const fields[N] = {
        PyFloat_FromDouble(f->time),
        Py_XNewRef(PyTuple_GetItem(objects[STATES], f->state)),
        Py_XNewRef(PyTuple_GetItem(objects[REASONS], f->reason)),
        PyFloat_FromDouble(f->stable_probability),
        PyFloat_FromDouble(f->instability),
        Py_BuildValue("(ddd)", f->force[0], f->force[1], f->force[2]),
        f->faults ? from_mask(objects[FAULTS_OF], f->faults) : PyTuple_New(0),
        f->faults ? PyObject_CallFunction(
                        objects[TAXELS_OF], "y#", (const char *)f->faulty_taxels,
                        (Py_ssize_t)sizeof f->faulty_taxels)
                  : PyTuple_New(0),
        Py_XNewRef(PyTuple_GetItem(objects[CAUSES], f->cause)),
        number_of(slip, f->slip_probability),
        number_of(speed, f->slip_speed),
        number_of(speed, f->slip_distance),
    };
    PyObject *result = NULL;
    int n_made = 0;
    while (n_made < N && fields[n_made] != NULL) {
        ++n_made;
    }
    if (n_made == N) {
        result = PyObject_CallFunctionObjArgs(
            objects[CONTACT_TYPE], fields[0], fields[1], fields[2], fields[3], fields[4], fields[5],
            fields[6], fields[7], fields[8], fields[9], fields[10], fields[11], NULL);
    }
    for (int k = 0; k < N; ++k) {
        Py_XDECREF(fields[k]);
    }
    return result;
}

static PyObject *estimates_get(PyObject *self, PyObject *name)
{
    const estimates *const e = (estimates *)self;
    PyObject *const index = /* borrowed */
        e->detector ? PyDict_GetItemWithError(e->detector->objects[FINGER_INDICES], name) : NULL;
    if (index == NULL) {
        if (!PyErr_Occurred()) {
            PyErr_SetObject(PyExc_KeyError, name);
        }
        return NULL;
    }
    const size_t i = PyLong_AsSize_t(index);
    if (i >= e->detector->base.hand.n_fingers) { /* also of an error, which is kept */
        return PyErr_Occurred() ? NULL : PyErr_Format(PyExc_IndexError, "finger %zu", i);
    }
    return make_finger(e, i);
}

static Py_ssize_t estimates_length(PyObject *self)
{
    const estimates *const e = (estimates *)self;
    return e->detector ? PyDict_Size(e->detector->objects[FINGER_INDICES]) : 0;
}

static PyObject *estimates_iter(PyObject *self)
{
    const estimates *const e = (estimates *)self;
    return e->detector ? PyObject_GetIter(e->detector->objects[FINGER_INDICES]) : PyErr_NoMemory();
}

static int estimates_traverse(PyObject *self, visitproc visit, void *arg)
{
    Py_VISIT(Py_TYPE(self));
    Py_VISIT((PyObject *)((estimates *)self)->detector);
    return 0;
}

static void estimates_dealloc(PyObject *self)
{
    PyTypeObject *const type = Py_TYPE(self);
    PyObject_GC_UnTrack(self);
    Py_XDECREF((PyObject *)((estimates *)self)->detector);
    PyObject_GC_Del(self);
    Py_DECREF(type);
}

static PyType_Slot estimates_slots[] = {
    {Py_tp_dealloc, SLOT(estimates_dealloc)}, {Py_tp_traverse, SLOT(estimates_traverse)},
    {Py_mp_subscript, SLOT(estimates_get)},   {Py_mp_length, SLOT(estimates_length)},
    {Py_tp_iter, SLOT(estimates_iter)},       {0, NULL},
};

static PyType_Spec estimates_spec = {
    "holdfast.kernel._extension.Estimates",
    offsetof(estimates, fingers),
    sizeof(holdfast_finger_estimate),
    Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE | Py_TPFLAGS_HAVE_GC,
    estimates_slots,
};

/* Call a method of a detector that no other call uses. */
static PyObject *call_locked(
    PyObject *self, PyObject *const *args, Py_ssize_t n_args,
    PyObject *(*method)(detector *, PyObject *const *, Py_ssize_t))
{
    detector *const s = (detector *)self;
    if (begin_use(&s->base) < 0) {
        return NULL;
    }
    PyObject *const result = method(s, args, n_args);
    s->base.is_in_use = false;
    return result;
}

/* Copy the numbers of a NumPy array (n_taxels, 3) of uint16 or float64 to the sample of a finger.
 *
 * Return false, without an exception, for all other objects, which Python converts. */
static bool copy_sample(const detector *s, PyObject *object, const holdfast_finger *finger)
{
    Py_buffer view;
    if ((PyObject *)Py_TYPE(object) != s->objects[ARRAY_TYPE]) {
        return false;
    }
    if (PyObject_GetBuffer(object, &view, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT) < 0) {
        PyErr_Clear();
        return false;
    }
    double *const target = s->readings + 3 * finger->first_taxel;
    const size_t n = 3 * finger->n_taxels;
    const char type = view.format != NULL && view.format[1] == '\0' ? view.format[0] : '\0';
    const size_t size = type == 'd' ? sizeof(double) : sizeof(uint16_t);
    const bool fits = (type == 'd' || type == 'H') && view.ndim == 2 &&
                      view.shape[0] == (Py_ssize_t)finger->n_taxels && view.shape[1] == 3 &&
                      view.len == (Py_ssize_t)(n * size);
    if (fits && type == 'd') {
        memcpy(target, view.buf, n * sizeof(double));
    } else if (fits) {
        const unsigned char *const bytes = view.buf;
        for (size_t i = 0; i < n; ++i) {
            uint16_t count;
            memcpy(&count, bytes + 2 * i, sizeof count); /* it may not be aligned */
            target[i] = count;
        }
    }
    PyBuffer_Release(&view);
    return fits;
}

/* Copy the samples of a dictionary. Return false, without an exception, if Python has to. */
static bool copy_samples(detector *s, PyObject *samples)
{
    const holdfast_hand *const hand = &s->base.hand;
    Py_ssize_t n_found = 0, position = 0, index = 0;
    PyObject *name, *index_object;
    if (!PyDict_CheckExact(samples)) {
        return false;
    }
    while (PyDict_Next(s->objects[FINGER_INDICES], &position, &name, &index_object)) {
        PyObject *const sample = PyDict_GetItemWithError(samples, name); /* borrowed */
        if (sample == NULL && PyErr_Occurred()) {
            PyErr_Clear();
            return false;
        }
        s->base.present[index] = sample != NULL;
        if (sample != NULL && !copy_sample(s, sample, &hand->fingers[index])) {
            return false;
        }
        n_found += sample != NULL;
        ++index;
    }
    return n_found == PyDict_Size(samples); /* else another finger, which is refused */
}

/* Copy the states of the fingers and of the hand. */
static void copy_states(const detector *s, char *states)
{
    const size_t n = s->base.hand.n_fingers;
    for (size_t i = 0; i < n; ++i) {
        states[i] = (char)s->d.decisions[i].state;
    }
    states[n] = (char)s->d.state;
}

/* Return the estimate of a hand; NULL with an exception. */
static PyObject *make_hand(detector *s, double time)
{
    const size_t n = s->base.hand.n_fingers;
    PyTypeObject *const type = (PyTypeObject *)s->objects[ESTIMATES_TYPE];
    estimates *const e = (estimates *)PyType_GenericAlloc(type, (Py_ssize_t)n);
    PyObject *const when = PyFloat_FromDouble(time);
    PyObject *const state = PyTuple_GetItem(s->objects[STATES], s->d.state), *result = NULL;
    if (e != NULL && when != NULL && state != NULL) {
        e->detector = (detector *)Py_NewRef((PyObject *)s);
        memcpy(e->fingers, s->estimates, n * sizeof *s->estimates);
        result = PyObject_CallFunctionObjArgs(s->objects[HAND_TYPE], when, state, e, NULL);
    }
    Py_XDECREF((PyObject *)e);
    Py_XDECREF(when);
    return result;
}

/* Report a change of states, if there is one. Return -1 with an exception. */
static int note_change(const detector *s, double time, const char *before, const char *after)
{
    const Py_ssize_t n = (Py_ssize_t)s->base.hand.n_fingers + 1;
    if (memcmp(before, after, (size_t)n) == 0) {
        return 0;
    }
    PyObject *const change = Py_BuildValue("(dy#y#)", time, before, n, after, n);
    PyObject *const done =
        change ? PyObject_CallFunctionObjArgs(s->objects[NOTE], change, NULL) : NULL;
    Py_XDECREF(change);
    Py_XDECREF(done);
    return done ? 0 : -1;
}

/* Process the sample that was copied. Return the estimate; NULL with an exception. */
static PyObject *process(detector *s, const double *readings, double time)
{
    copy_states(s, s->before);
    s->base.last_time = time;
    WIDEST(holdfast_detect)(&s->model, &s->d, time, readings, s->base.present, s->estimates);
    copy_states(s, s->after);
    PyObject *result = make_hand(s, time);
    if (result != NULL && note_change(s, time, s->before, s->after) < 0) {
        Py_CLEAR(result);
    }
    return result;
}

/* update(samples, time): the estimate, or None if Python has to convert or to refuse them. */
static PyObject *update_locked(detector *s, PyObject *const *args, Py_ssize_t n_args)
{
    if (check_count(n_args, 2) < 0) {
        return NULL;
    }
    const double time = PyFloat_AsDouble(args[1]);
    if (PyErr_Occurred()) {
        PyErr_Clear();
        return Py_NewRef(Py_None);
    }
    PyObject *result = NULL;
    if (time > s->base.last_time && time <= DBL_MAX && copy_samples(s, args[0])) {
        result = process(s, s->readings, time);
    } else {
        result = Py_NewRef(Py_None);
    }
    return result;
}

/* step(readings, present, time): the estimate of a sample that Python has converted. */
static PyObject *step_locked(detector *s, PyObject *const *args, Py_ssize_t n_args)
{
    static const parameter expected[] = {
        {'d', false, "readings", {TAXELS, AXES}}, {'?', false, "present", {FINGERS}}};
    Py_ssize_t lengths[N_AXES] = LENGTHS(
        [FINGERS] = (Py_ssize_t)s->base.hand.n_fingers, [TAXELS] = (Py_ssize_t)s->base.n_taxels);
    array arrays[2] = {0};
    PyObject *result = NULL;
    if (check_count(n_args, 3) == 0 && read_arrays(args, 2, expected, 2, lengths, arrays) == 0) {
        const double time = PyFloat_AsDouble(args[2]);
        const unsigned char *const is_present = arrays[1].view.buf;
        for (size_t f = 0; f < s->base.hand.n_fingers; ++f) {
            s->base.present[f] = is_present[f] != 0;
        }
        if (time > s->base.last_time && time <= DBL_MAX) {
            result = process(s, arrays[0].data, time);
        } else if (!PyErr_Occurred()) {
            PyErr_SetString(PyExc_ValueError, "a finite time later than the one before expected");
        }
    }
    release(arrays, 2);
    return result;
}

/* Process n samples, and fill the estimates of the fingers and the state of the hand. */
static void run_all(
    detector *s, const array *readings, const array *present, const array *times, const array *out,
    const array *hand)
{
    const size_t n = (size_t)times->view.shape[0], n_fingers = s->base.hand.n_fingers;
    const unsigned char *is_present = present->view.buf;
    holdfast_finger_estimate *const rows = out->view.buf;
    double *const states = hand->data;
    for (size_t k = 0; k < n; ++k) {
        for (size_t f = 0; f < n_fingers; ++f) {
            s->base.present[f] = *is_present++ != 0;
        }
        states[k] = WIDEST(holdfast_detect)(
            &s->model, &s->d, times->data[k], readings->data + 3 * s->base.n_taxels * k,
            s->base.present, rows + n_fingers * k);
    }
}

/* Report the changes of n samples whose states are in rows. Return -1 with an exception. */
static int note_changes(detector *s, const array *times, const array *out, const array *hand)
{
    const size_t n = (size_t)times->view.shape[0], n_fingers = s->base.hand.n_fingers;
    const holdfast_finger_estimate *row = out->view.buf;
    for (size_t k = 0; k < n; ++k, row += n_fingers) {
        for (size_t i = 0; i < n_fingers; ++i) {
            s->after[i] = (char)row[i].state;
        }
        s->after[n_fingers] = (char)hand->data[k];
        if (note_change(s, times->data[k], s->before, s->after) < 0) {
            return -1;
        }
        memcpy(s->before, s->after, n_fingers + 1);
    }
    return 0;
}

/* run(readings, present, times, estimates, hand): as `update`, of n samples. */
static PyObject *run_locked(detector *s, PyObject *const *args, Py_ssize_t n_args)
{
    static const parameter expected[] = {
        {'d', false, "readings", {N, TAXELS, AXES}},
        {'?', false, "present", {N, FINGERS}},
        {'d', false, "times", {N}}, /* structs of all fingers, as doubles: aligned */
        {'d', true, "estimates", {N, COLUMNS}},
        {'d', true, "hand", {N}},
    };
    const size_t n_fingers = s->base.hand.n_fingers;
    Py_ssize_t lengths[N_AXES] = LENGTHS(
        [FINGERS] = (Py_ssize_t)n_fingers, [TAXELS] = (Py_ssize_t)s->base.n_taxels,
        [COLUMNS] = (Py_ssize_t)(n_fingers * sizeof *s->estimates / sizeof(double)));
    array a[MAX_ARRAYS] = {0}, *const times = &a[2], *const out = &a[3], *const hand = &a[4];
    PyObject *result = NULL;
    if (read_arrays(args, n_args, expected, MAX_ARRAYS, lengths, a) == 0 &&
        check_times(times, s->base.last_time) == 0) {
        s->base.last_time = lengths[N] > 0 ? times->data[lengths[N] - 1] : s->base.last_time;
        copy_states(s, s->before);
        Py_BEGIN_ALLOW_THREADS
        run_all(s, &a[0], &a[1], times, out, hand);
        Py_END_ALLOW_THREADS
        result = note_changes(s, times, out, hand) < 0 ? NULL : Py_NewRef(Py_None);
    }
    release(a, MAX_ARRAYS);
    return result;
}

/* set_rules(rules, weights): change them from the next sample on. */
static PyObject *set_rules_locked(detector *s, PyObject *const *args, Py_ssize_t n_args)
{
    if (check_count(n_args, 2) < 0 || set_rules(s, args[0], args[1]) < 0) {
        return NULL;
    }
    return Py_NewRef(Py_None);
}

/* baselines(out): fill (n_taxels, 3) and return for each finger whether its tare is complete. */
static PyObject *baselines_locked(detector *s, PyObject *const *args, Py_ssize_t n_args)
{
    static const parameter expected[] = {{'d', true, "out", {TAXELS, AXES}}};
    Py_ssize_t lengths[N_AXES] = LENGTHS([TAXELS] = (Py_ssize_t)s->base.n_taxels);
    const holdfast_hand *const hand = &s->base.hand;
    array out = {0};
    PyObject *result = NULL;
    if (read_arrays(args, n_args, expected, 1, lengths, &out) == 0) {
        result = PyTuple_New((Py_ssize_t)hand->n_fingers);
    }
    for (size_t i = 0; result != NULL && i < hand->n_fingers; ++i) {
        const bool is_tared =
            holdfast_baseline(&s->model, &s->d, i, out.data + 3 * hand->fingers[i].first_taxel);
        PyTuple_SetItem(result, (Py_ssize_t)i, PyBool_FromLong(is_tared)); /* cannot fail */
    }
    release(&out, 1);
    return result;
}

/* last_time(): of the newest sample [s]; -infinity before the first. */
static PyObject *detector_last_time(PyObject *self, PyObject *const *args, Py_ssize_t n_args)
{
    (void)args;
    return check_count(n_args, 0) < 0 ? NULL
                                      : PyFloat_FromDouble(((detector *)self)->base.last_time);
}

#define LOCKED(name)                                                                               \
    static PyObject *detector_##name(PyObject *self, PyObject *const *args, Py_ssize_t n_args)     \
    {                                                                                              \
        return call_locked(self, args, n_args, name##_locked);                                     \
    }
LOCKED(update)
LOCKED(step)
LOCKED(run)
LOCKED(set_rules)
LOCKED(baselines)

static PyMethodDef detector_methods[] = {
    METHOD(update, detector_update),
    METHOD(step, detector_step),
    METHOD(run, detector_run),
    METHOD(set_rules, detector_set_rules),
    METHOD(baselines, detector_baselines),
    METHOD(last_time, detector_last_time),
    {NULL, NULL, 0, NULL},
};

static PyType_Slot detector_slots[] = {
    {Py_tp_new, SLOT(detector_new)},           {Py_tp_dealloc, SLOT(detector_dealloc)},
    {Py_tp_traverse, SLOT(detector_traverse)}, {Py_tp_clear, SLOT(detector_clear)},
    {Py_tp_methods, detector_methods},         {0, NULL},
};

static PyType_Spec detector_spec = {
    "holdfast.kernel._extension.Detector",   sizeof(detector), 0,
    Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_GC, detector_slots,
};
