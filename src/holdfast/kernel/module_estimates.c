/* Estimates of the extension module: a part of module.c, which includes it.
 *
 * An estimate of a hand holds a copy of the C structs of its fingers. The Python object of a finger
 * is made when it is read. */

/* What makes the Python objects of an estimate; a detector and its estimates share it. */
enum {
    MAKE_HAND,
    MAKE_ESTIMATES, /* subclass of Estimates */
    MAKE_FINGER,
    STATE_OBJECTS, /* tuples, by code */
    REASON_OBJECTS,
    CAUSE_OBJECTS,
    FAULTS_OF, /* functions of a mask */
    TAXELS_OF,
    PLACES, /* dictionary: number of each finger by its name */
    HEADS,  /* tuple of a number for each finger: 1 with a head `slip`, 2 with `slip_speed` too */
    N_MAKERS
};

/* Estimates of the fingers of a hand at one instant, by name. */
typedef struct {
    PyObject_VAR_HEAD PyObject *makers; /* tuple of the objects above */
    holdfast_finger_estimate fingers[1];
} estimates;

static PyObject *maker(const estimates *e, Py_ssize_t i)
{
    return PyTuple_GetItem(e->makers, i); /* borrowed */
}

static void estimates_dealloc(PyObject *self)
{
    PyTypeObject *const type =
        Py_TYPE(self); /* the class in Python, which has garbage collection */
    void *const slot = PyType_GetSlot(type, Py_tp_free);
    freefunc free_object;
    memcpy(&free_object, &slot, sizeof slot); /* ISO C has no cast to a pointer to a function */
    Py_XDECREF(((estimates *)self)->makers);
    free_object(self);
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

/* Return a number that a model has or not as a Python object. */
static PyObject *number_or_none(double value, int is_given)
{
    return is_given ? PyFloat_FromDouble(value) : Py_NewRef(Py_None);
}

static PyObject *make_finger(const estimates *e, Py_ssize_t i)
{
    enum { N = 12 };
    const holdfast_finger_estimate *const f = &e->fingers[i];
    const long heads = PyLong_AsLong(PyTuple_GetItem(maker(e, HEADS), i));
    const int has_speed = heads > 1;
    PyObject *const fields[N] = {
        PyFloat_FromDouble(f->time),
        Py_XNewRef(PyTuple_GetItem(maker(e, STATE_OBJECTS), f->state)),
        Py_XNewRef(PyTuple_GetItem(maker(e, REASON_OBJECTS), f->reason)),
        PyFloat_FromDouble(f->stable_probability),
        PyFloat_FromDouble(f->instability),
        Py_BuildValue("(ddd)", f->force[0], f->force[1], f->force[2]),
        f->faults ? from_mask(maker(e, FAULTS_OF), f->faults) : PyTuple_New(0),
        f->faults ? PyObject_CallFunction(
                        maker(e, TAXELS_OF), "y#", (const char *)f->faulty_taxels,
                        (Py_ssize_t)sizeof f->faulty_taxels)
                  : PyTuple_New(0),
        Py_XNewRef(PyTuple_GetItem(maker(e, CAUSE_OBJECTS), f->cause)),
        number_or_none(f->slip_probability, heads > 0),
        number_or_none(f->slip_speed, has_speed),
        number_or_none(f->slip_distance, has_speed),
    };
    PyObject *result = NULL;
    int n_made = 0;
    while (n_made < N && fields[n_made] != NULL) {
        ++n_made;
    }
    if (n_made == N) {
        result = PyObject_CallFunctionObjArgs(
            maker(e, MAKE_FINGER), fields[0], fields[1], fields[2], fields[3], fields[4], fields[5],
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
    PyObject *const place =
        e->makers ? PyDict_GetItemWithError(maker(e, PLACES), name) : NULL; /* borrowed */
    if (place == NULL) {
        if (!PyErr_Occurred()) {
            PyErr_SetObject(PyExc_KeyError, name);
        }
        return NULL;
    }
    return make_finger(e, PyLong_AsSsize_t(place));
}

static Py_ssize_t estimates_length(PyObject *self)
{
    const estimates *const e = (estimates *)self;
    return e->makers ? PyDict_Size(maker(e, PLACES)) : 0;
}

static PyObject *estimates_iter(PyObject *self)
{
    const estimates *const e = (estimates *)self;
    return e->makers ? PyObject_GetIter(maker(e, PLACES)) : PyErr_NoMemory();
}

static PyType_Slot estimates_slots[] = {
    {Py_tp_dealloc, SLOT(estimates_dealloc)},
    {Py_mp_subscript, SLOT(estimates_get)},
    {Py_mp_length, SLOT(estimates_length)},
    {Py_tp_iter, SLOT(estimates_iter)},
    {0, NULL},
};

static PyType_Spec estimates_spec = {
    "holdfast.kernel._extension.Estimates",
    offsetof(estimates, fingers),
    sizeof(holdfast_finger_estimate),
    Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE,
    estimates_slots,
};
