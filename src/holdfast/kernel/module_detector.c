/* The detector of the extension module: a part of module.c, which includes it.
 *
 * `Detector.update` copies the samples of a dictionary, processes them, and returns an estimate of
 * the hand, see module_estimates.c. It keeps the GIL; `Detector.run` releases it. */

/* A detector of a hand. It begins with a stream, whose tables and memory it uses. */
typedef struct {
    stream base;
    holdfast_model model;
    holdfast_detector_memory d;
    void *rules; /* tables that `set_rules` replaces */
    void *weights;
    double *readings;                    /* (n_taxels, 3) of one sample */
    holdfast_finger_estimate *estimates; /* (n_fingers) */
    char *before;                        /* (n_fingers + 1) states of fingers and hand */
    char *after;
    PyObject *makers;
    PyObject *array_type; /* numpy.ndarray */
    PyObject *note;       /* is called with (time, states before, states after) at a change */
} detector;

#define OF_MODEL(type, name)                                                                       \
    {                                                                                              \
#name, type, offsetof(holdfast_model, name)                                                \
    }
#define OF_RULE(type, name)                                                                        \
    {                                                                                              \
#name, type, offsetof(holdfast_rule, name)                                                 \
    }
#define OF_HEAD(type, name)                                                                        \
    {                                                                                              \
#name, type, offsetof(holdfast_head, name)                                                 \
    }

static const field model_fields[] = {
    OF_MODEL(SIZE, n_model_fingers), OF_MODEL(REAL, hysteresis),
    OF_MODEL(REAL, min_duration),    OF_MODEL(REAL, hold),
    OF_MODEL(FLAG, has_filter),      OF_MODEL(REAL, switching),
    OF_MODEL(FLAG, zero_unknown),    {NULL, SIZE, 0},
};

static const field rule_fields[] = {
    OF_RULE(CODE, contact),
    OF_RULE(REAL, contact_limit),
    {NULL, SIZE, 0},
};

static const field head_fields[] = {
    OF_HEAD(SIZE, n_outputs), OF_HEAD(SIZE, n_features),
    OF_HEAD(SIZE, first),     OF_HEAD(FLAG, has_squares),
    OF_HEAD(REAL, threshold), OF_HEAD(REAL, gain),
    OF_HEAD(REAL, hold),      OF_HEAD(REAL, highest),
    OF_HEAD(CODES_6, causes), {NULL, SIZE, 0},
};

/* Fill the rule of each finger from dictionaries, or set an exception and return -1. */
static int fill_rules(PyObject *list, PyObject *heads, holdfast_rule *rules, size_t n)
{
    if (!PyList_Check(list) || !PyList_Check(heads) || PyList_Size(list) != (Py_ssize_t)n ||
        PyList_Size(heads) != (Py_ssize_t)(n * HOLDFAST_N_HEADS)) {
        PyErr_SetString(
            PyExc_ValueError, "lists of a rule and four heads for each finger expected");
        return -1;
    }
    for (size_t i = 0; i < n; ++i) {
        if (read_item(list, i, rule_fields, &rules[i]) < 0) {
            return -1;
        }
        for (size_t name = 0; name < HOLDFAST_N_HEADS; ++name) {
            const size_t place = i * HOLDFAST_N_HEADS + name;
            if (read_item(heads, place, head_fields, &rules[i].heads[name]) < 0) {
                return -1;
            }
        }
    }
    return 0;
}

/* Replace rules and weights of a detector, or set an exception, return -1 and change nothing. */
static int set_tables(detector *s, PyObject *list, PyObject *heads, PyObject *numbers)
{
    holdfast_model model = s->model;
    array a = {0};
    holdfast_rule *rules = NULL;
    double *weights = NULL;
    if (get_array('d', numbers, "weights", 1, PyBUF_SIMPLE, &a) < 0) {
        goto failed;
    }
    model.n_weights = (size_t)a.view.shape[0];
    rules = PyMem_Calloc(model.hand->n_fingers, sizeof *rules);
    weights = PyMem_Malloc(model.n_weights * sizeof(double) + 1);
    if (rules == NULL || weights == NULL) {
        PyErr_NoMemory();
        goto failed;
    }
    memcpy(weights, a.data, model.n_weights * sizeof(double));
    if (fill_rules(list, heads, rules, model.hand->n_fingers) < 0) {
        goto failed;
    }
    model.rules = rules;
    model.weights = weights;
    const char *const wrong = holdfast_check_model(&model);
    if (wrong != NULL) {
        PyErr_Format(PyExc_ValueError, "tables that do not fit: %s", wrong);
        goto failed;
    }
    PyBuffer_Release(&a.view);
    PyMem_Free(s->rules);
    PyMem_Free(s->weights);
    s->rules = rules;
    s->weights = weights;
    s->model = model;
    return 0;
failed:
    PyBuffer_Release(&a.view);
    PyMem_Free(rules);
    PyMem_Free(weights);
    return -1;
}

static PyObject *detector_new(PyTypeObject *type, PyObject *args, PyObject *names)
{
    PyObject *stream_args, *model, *rules, *heads, *weights, *makers, *array_type, *note;
    if ((names != NULL && PyDict_Size(names) > 0) ||
        !PyArg_ParseTuple(
            args, "O!O!OOOO!OO:Detector", &PyTuple_Type, &stream_args, &PyDict_Type, &model, &rules,
            &heads, &weights, &PyTuple_Type, &makers, &array_type, &note)) {
        return NULL;
    }
    if (PyTuple_Size(makers) != N_MAKERS || !PyDict_Check(PyTuple_GetItem(makers, PLACES)) ||
        !PyTuple_Check(PyTuple_GetItem(makers, HEADS))) {
        PyErr_SetString(PyExc_ValueError, "makers of an estimate expected");
        return NULL;
    }
    detector *const s = (detector *)PyType_GenericAlloc(type, 0); /* all bytes are 0 */
    if (s == NULL) {
        return NULL;
    }
    s->makers = Py_NewRef(makers);
    s->array_type = Py_NewRef(array_type);
    s->note = Py_NewRef(note);
    s->base.last_time = -INFINITY;
    s->model.hand = &s->base.hand;
    if (read_tables(&s->base, stream_args) < 0 || read_struct(model, model_fields, &s->model) < 0 ||
        set_tables(s, rules, heads, weights) < 0) {
        goto failed;
    }
    const size_t n = s->base.hand.n_fingers;
    if (PyDict_Size(PyTuple_GetItem(makers, PLACES)) != (Py_ssize_t)n ||
        PyTuple_Size(PyTuple_GetItem(makers, HEADS)) != (Py_ssize_t)n) {
        PyErr_SetString(PyExc_ValueError, "makers of other fingers than those of the tables");
        goto failed;
    }
    s->readings = PyMem_Calloc(3 * s->base.n_taxels, sizeof(double));
    s->estimates = PyMem_Calloc(n, sizeof *s->estimates);
    s->d.decisions = PyMem_Calloc(n, sizeof(holdfast_decision));
    s->before = PyMem_Calloc(2, n + 1);
    s->after = s->before + n + 1;
    if (s->readings == NULL || s->estimates == NULL || s->before == NULL ||
        s->d.decisions == NULL) {
        PyErr_NoMemory();
        goto failed;
    }
    s->d.memory = s->base.memory; /* its arrays, which have the baseline already */
    holdfast_start_decisions(&s->model, &s->d);
    return (PyObject *)s;
failed:
    Py_DECREF(s);
    return NULL;
}

static void detector_dealloc(PyObject *self)
{
    detector *const s = (detector *)self;
    PyMem_Free(s->rules);
    PyMem_Free(s->weights);
    PyMem_Free(s->readings);
    PyMem_Free(s->estimates);
    PyMem_Free(s->before);
    PyMem_Free(s->d.decisions);
    Py_XDECREF(s->makers);
    Py_XDECREF(s->array_type);
    Py_XDECREF(s->note);
    stream_dealloc(self);
}

/* Call a method, unless a call of the detector runs: what its arguments run, or another thread
 * while the GIL is released, may call it. */
static PyObject *call_alone(
    PyObject *self, PyObject *const *args, Py_ssize_t n_args,
    PyObject *(*method)(detector *, PyObject *const *, Py_ssize_t))
{
    detector *const s = (detector *)self;
    if (s->base.is_in_use) {
        PyErr_SetString(PyExc_RuntimeError, "another thread is using this detector");
        return NULL;
    }
    s->base.is_in_use = true;
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
    if ((PyObject *)Py_TYPE(object) != s->array_type) {
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
    Py_ssize_t n_found = 0, place = 0, index = 0;
    PyObject *name, *index_object;
    if (!PyDict_CheckExact(samples)) {
        return false;
    }
    while (PyDict_Next(PyTuple_GetItem(s->makers, PLACES), &place, &name, &index_object)) {
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
static PyObject *make_hand(const detector *s, double time)
{
    const size_t n = s->base.hand.n_fingers;
    PyTypeObject *const type = (PyTypeObject *)PyTuple_GetItem(s->makers, MAKE_ESTIMATES);
    estimates *const e = (estimates *)PyType_GenericAlloc(type, (Py_ssize_t)n);
    PyObject *const when = PyFloat_FromDouble(time);
    PyObject *const states = PyTuple_GetItem(s->makers, STATE_OBJECTS);
    PyObject *const state = PyTuple_GetItem(states, s->d.state), *result = NULL;
    if (e != NULL && when != NULL && state != NULL) {
        e->makers = Py_NewRef(s->makers);
        memcpy(e->fingers, s->estimates, n * sizeof *s->estimates);
        result = PyObject_CallFunctionObjArgs(
            PyTuple_GetItem(s->makers, MAKE_HAND), when, state, e, NULL);
    }
    Py_XDECREF((PyObject *)e);
    Py_XDECREF(when);
    return result;
}

/* Process the sample that was copied. Return the estimate; NULL with an exception. */
static PyObject *process(detector *s, const double *readings, double time)
{
    const size_t n = s->base.hand.n_fingers + 1;
    copy_states(s, s->before);
    s->base.last_time = time;
    holdfast_detect(&s->model, &s->d, time, readings, s->base.present, s->estimates);
    copy_states(s, s->after);
    PyObject *result = make_hand(s, time);
    if (result != NULL && memcmp(s->before, s->after, n) != 0) {
        PyObject *const change =
            Py_BuildValue("(dy#y#)", time, s->before, (Py_ssize_t)n, s->after, (Py_ssize_t)n);
        PyObject *const done = change ? PyObject_CallFunctionObjArgs(s->note, change, NULL) : NULL;
        if (done == NULL) {
            Py_CLEAR(result);
        }
        Py_XDECREF(change);
        Py_XDECREF(done);
    }
    return result;
}

/* update(samples, time): the estimate, or None if Python has to convert or to refuse them. */
static PyObject *update_alone(detector *s, PyObject *const *args, Py_ssize_t n_args)
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
static PyObject *step_alone(detector *s, PyObject *const *args, Py_ssize_t n_args)
{
    if (check_count(n_args, 3) < 0) {
        return NULL;
    }
    const double time = PyFloat_AsDouble(args[2]);
    array arrays[2] = {0}, *const readings = &arrays[0], *const present = &arrays[1];
    PyObject *result = NULL;
    if (PyErr_Occurred() || get_array('d', args[0], "readings", 2, PyBUF_SIMPLE, readings) < 0 ||
        get_array('?', args[1], "present", 1, PyBUF_SIMPLE, present) < 0 ||
        check_shape(readings, SHAPE((Py_ssize_t)s->base.n_taxels, 3)) < 0 ||
        check_shape(present, SHAPE((Py_ssize_t)s->base.hand.n_fingers)) < 0) {
        goto done;
    }
    if (!(time > s->base.last_time && time <= DBL_MAX)) {
        PyErr_SetString(PyExc_ValueError, "a finite time later than the one before expected");
        goto done;
    }
    const unsigned char *const is_present = present->view.buf;
    for (size_t f = 0; f < s->base.hand.n_fingers; ++f) {
        s->base.present[f] = is_present[f] != 0;
    }
    result = process(s, readings->data, time);
done:
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
        states[k] = holdfast_detect(
            &s->model, &s->d, times->data[k], readings->data + 3 * s->base.n_taxels * k,
            s->base.present, rows + n_fingers * k);
    }
}

/* run(readings, present, times, estimates, hand): as `update`, without events. */
static PyObject *run_alone(detector *s, PyObject *const *args, Py_ssize_t n_args)
{
    if (check_count(n_args, 5) < 0) {
        return NULL;
    }
    array arrays[5] = {0}, *const readings = &arrays[0], *const present = &arrays[1];
    array *const times = &arrays[2], *const out = &arrays[3], *const hand = &arrays[4];
    PyObject *result = NULL;
    if (get_array('d', args[0], "readings", 3, PyBUF_SIMPLE, readings) < 0 ||
        get_array('?', args[1], "present", 2, PyBUF_SIMPLE, present) < 0 ||
        get_array('d', args[2], "times", 1, PyBUF_SIMPLE, times) < 0 ||
        /* (n, n_fingers, size of a struct in doubles): its bytes, aligned */
        get_array('d', args[3], "estimates", 3, PyBUF_WRITABLE, out) < 0 ||
        get_array('d', args[4], "hand", 1, PyBUF_WRITABLE, hand) < 0) {
        goto done;
    }
    const Py_ssize_t n = times->view.shape[0], n_fingers = (Py_ssize_t)s->base.hand.n_fingers;
    const Py_ssize_t n_taxels = (Py_ssize_t)s->base.n_taxels;
    const Py_ssize_t n_doubles = (Py_ssize_t)(sizeof(holdfast_finger_estimate) / sizeof(double));
    if (check_shape(readings, SHAPE(n, n_taxels, 3)) < 0 ||
        check_shape(present, SHAPE(n, n_fingers)) < 0 ||
        check_shape(out, SHAPE(n, n_fingers, n_doubles)) < 0 || check_shape(hand, SHAPE(n)) < 0 ||
        check_apart(arrays, 5, 2) < 0 || check_times(times, s->base.last_time) < 0) {
        goto done;
    }
    if (n > 0) {
        s->base.last_time = times->data[n - 1];
    }
    Py_BEGIN_ALLOW_THREADS
    run_all(s, readings, present, times, out, hand);
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
done:
    release(arrays, 5);
    return result;
}

/* set_rules(rules, heads, weights): change them from the next sample on. */
static PyObject *set_rules_alone(detector *s, PyObject *const *args, Py_ssize_t n_args)
{
    if (check_count(n_args, 3) < 0 || set_tables(s, args[0], args[1], args[2]) < 0) {
        return NULL;
    }
    return Py_NewRef(Py_None);
}

/* baselines(out): fill (n_taxels, 3) and return for each finger whether its tare is complete. */
static PyObject *baselines_alone(detector *s, PyObject *const *args, Py_ssize_t n_args)
{
    if (check_count(n_args, 1) < 0) {
        return NULL;
    }
    array out = {0};
    PyObject *result = NULL;
    const holdfast_hand *const hand = &s->base.hand;
    if (get_array('d', args[0], "out", 2, PyBUF_WRITABLE, &out) == 0 &&
        check_shape(&out, SHAPE((Py_ssize_t)s->base.n_taxels, 3)) == 0) {
        result = PyList_New((Py_ssize_t)hand->n_fingers);
    }
    for (size_t i = 0; result != NULL && i < hand->n_fingers; ++i) {
        const holdfast_finger *const finger = &hand->fingers[i];
        const bool is_tared =
            holdfast_baseline(&s->model, &s->d, i, out.data + 3 * finger->first_taxel);
        if (PyList_SetItem(result, (Py_ssize_t)i, PyBool_FromLong(is_tared)) < 0) {
            Py_CLEAR(result);
        }
    }
    PyBuffer_Release(&out.view);
    return result;
}

/* last_time(): of the newest sample [s]; -infinity before the first. */
static PyObject *detector_last_time(PyObject *self, PyObject *const *args, Py_ssize_t n_args)
{
    (void)args;
    return check_count(n_args, 0) < 0 ? NULL
                                      : PyFloat_FromDouble(((detector *)self)->base.last_time);
}

#define ALONE(name)                                                                                \
    static PyObject *detector_##name(PyObject *self, PyObject *const *args, Py_ssize_t n_args)     \
    {                                                                                              \
        return call_alone(self, args, n_args, name##_alone);                                       \
    }
ALONE(update)
ALONE(step)
ALONE(run)
ALONE(set_rules)
ALONE(baselines)

#define METHOD(name)                                                                               \
    {                                                                                              \
#name, (PyCFunction)(void (*)(void))detector_##name, METH_FASTCALL, NULL                   \
    }

static PyMethodDef detector_methods[] = {
    METHOD(update),    METHOD(step),      METHOD(run),           METHOD(set_rules),
    METHOD(baselines), METHOD(last_time), {NULL, NULL, 0, NULL},
};

static PyType_Slot detector_slots[] = {
    {Py_tp_new, SLOT(detector_new)},
    {Py_tp_dealloc, SLOT(detector_dealloc)},
    {Py_tp_methods, detector_methods},
    {0, NULL},
};

static PyType_Spec detector_spec = {
    "holdfast.kernel._extension.Detector", sizeof(detector), 0, Py_TPFLAGS_DEFAULT, detector_slots,
};

static int add_detector(PyObject *module)
{
    PyObject *const type = PyType_FromModuleAndSpec(module, &detector_spec, NULL);
    PyObject *const found = PyType_FromModuleAndSpec(module, &estimates_spec, NULL);
    const int result = type == NULL || found == NULL ||
                               PyModule_AddObjectRef(module, "Detector", type) < 0 ||
                               PyModule_AddObjectRef(module, "Estimates", found) < 0
                           ? -1
                           : 0;
    Py_XDECREF(type);
    Py_XDECREF(found);
    return result;
}
