/* The extension module: Python objects in, C pointers out, no arithmetic.
 *
 * Only the limited API of Python 3.11 is used, so that one build serves all later versions.
 * Arrays come in by the buffer protocol and are checked here: type, shape, order in memory. The
 * C functions trust their arguments. While they run on many samples, the GIL is released: the
 * buffers cannot go away, but a caller who changes the numbers in another thread gets either of
 * them. A stream that another thread is using raises an error.
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <float.h>
#include <string.h>

#include "arrays.h"
#include "batch.h"
#include "counts.h"
#include "detector.h"
#include "kernel.h"

/* The size of the scratch memory of a longer window, ten rows of doubles, could overflow. */
#define MAX_WINDOW (PY_SSIZE_T_MAX / 1024)

/* Return 0 if the last n_out of n arrays share no memory with others, else set an exception. */
static int check_apart(const array *arrays, size_t n, size_t n_out)
{
    for (size_t i = n - n_out; i < n; ++i) {
        const char *const out = arrays[i].view.buf;
        for (size_t j = 0; j < i; ++j) {
            const char *const other = arrays[j].view.buf;
            if (other + arrays[j].view.len > out && out + arrays[i].view.len > other) {
                PyErr_Format(
                    PyExc_ValueError, "%s and %s share memory", arrays[j].name, arrays[i].name);
                return -1;
            }
        }
    }
    return 0;
}

static int check_count(Py_ssize_t n_args, Py_ssize_t expected)
{
    if (n_args == expected) {
        return 0;
    }
    PyErr_Format(PyExc_TypeError, "%zd arguments expected, %zd given", expected, n_args);
    return -1;
}

#include "module_batch.c"

static PyObject *parse_counts(PyObject *Py_UNUSED(module), PyObject *const *args, Py_ssize_t n_args)
{
    Py_buffer text, list;
    if (check_count(n_args, 2) < 0 || PyObject_GetBuffer(args[0], &text, PyBUF_SIMPLE) < 0) {
        return NULL;
    }
    PyObject *counts = NULL;
    if (PyObject_GetBuffer(args[1], &list, PyBUF_SIMPLE) == 0) {
        counts = PyByteArray_FromStringAndSize(NULL, text.len / 5 * 2);
        if (counts != NULL &&
            (list.len == 0 || !holdfast_parse_counts(
                                  text.buf, (size_t)text.len, list.buf, (size_t)list.len,
                                  (uint16_t *)PyByteArray_AsString(counts)))) {
            Py_DECREF(counts);
            counts = Py_NewRef(Py_None);
        }
        PyBuffer_Release(&list);
    }
    PyBuffer_Release(&text);
    return counts;
}

/* A feature stream of a hand: its tables, its memory, and who uses it. */
typedef struct {
    PyObject_HEAD
    holdfast_hand hand;
    holdfast_memory memory;
    void *blocks[8]; /* all that was allocated for this stream: `read_tables` does so eight times */
    size_t n_blocks;
    bool *present;    /* (n_fingers) of one sample */
    size_t n_taxels;  /* of all fingers */
    double last_time; /* of the newest sample [s] */
    bool is_in_use;   /* a call without the GIL is running */
} stream;

/* The fields of the tables, which Python gives by name in dictionaries. */
typedef enum { SIZE, CODE, FLAG, REAL, CODES_6 } field_type;

typedef struct {
    const char *name;
    field_type type;
    size_t offset;
} field;

/* clang-format off */
#define OF_HAND(type, name) {#name, type, offsetof(holdfast_hand, name)}
#define OF_FINGER(type, name) {#name, type, offsetof(holdfast_finger, name)}
#define OF_FEATURE(type, name) {#name, type, offsetof(holdfast_feature, name)}
#define OF_LAG(type, name) {#name, type, offsetof(holdfast_lag, name)}

static const field hand_fields[] = {
    OF_HAND(SIZE, n_fingers), OF_HAND(SIZE, n_lanes), OF_HAND(SIZE, n_features),
    OF_HAND(SIZE, n_lags), OF_HAND(SIZE, n_history), OF_HAND(SIZE, n_channels),
    OF_HAND(SIZE, n_levels), OF_HAND(SIZE, n_track), OF_HAND(REAL, period),
    OF_HAND(CODE, tare_kind), OF_HAND(REAL, tare_seconds), OF_HAND(REAL, noise_seconds),
    OF_HAND(REAL, average_gain), OF_HAND(FLAG, alike), OF_HAND(FLAG, has_centres),
    OF_HAND(FLAG, has_ratios), {NULL, SIZE, 0},
};

static const field finger_fields[] = {
    OF_FINGER(SIZE, first_taxel), OF_FINGER(SIZE, n_taxels), OF_FINGER(SIZE, first),
    OF_FINGER(REAL, n_used), OF_FINGER(REAL, low), OF_FINGER(REAL, high), OF_FINGER(REAL, low_end),
    OF_FINGER(REAL, high_end), OF_FINGER(REAL, max_offset), OF_FINGER(REAL, min_noise),
    OF_FINGER(REAL, rounding_noise), OF_FINGER(REAL, max_field), OF_FINGER(REAL, max_step), OF_FINGER(REAL, normal[0]),
    OF_FINGER(REAL, normal[1]), OF_FINGER(REAL, normal[2]),
    OF_FINGER(SIZE, sigma_window), OF_FINGER(SIZE, ready_window), OF_FINGER(FLAG, is_magnetic),
    OF_FINGER(FLAG, bridges),
    {NULL, SIZE, 0},
};

static const field feature_fields[] = {
    OF_FEATURE(CODE, kind), OF_FEATURE(CODE, transform), OF_FEATURE(FLAG, of_hand),
    OF_FEATURE(SIZE, window), OF_FEATURE(SIZE, lag), OF_FEATURE(SIZE, same_as),
    OF_FEATURE(REAL, floor), {NULL, SIZE, 0},
};

static const field lag_fields[] = {
    OF_LAG(SIZE, samples), OF_LAG(REAL, seconds), OF_LAG(FLAG, has_changes),
    OF_LAG(FLAG, has_seconds), OF_LAG(FLAG, has_means), OF_LAG(FLAG, has_ratios), {NULL, SIZE, 0},
};
/* clang-format on */

/* Store the value of a field, or set an exception. */
static void store(PyObject *value, field_type type, void *target)
{
    if (type == SIZE) {
        *(size_t *)target = PyLong_AsSize_t(value);
    } else if (type == REAL) {
        *(double *)target = PyFloat_AsDouble(value);
    } else if (type == FLAG) {
        *(bool *)target = PyObject_IsTrue(value) == 1;
    } else if (type == CODE) {
        const long code = PyLong_AsLong(value);
        if (code < INT32_MIN || code > INT32_MAX) {
            PyErr_Format(PyExc_OverflowError, "%ld has more than 32 bits", code);
        }
        *(int32_t *)target = (int32_t)code;
    } else {
        for (Py_ssize_t i = 0; i < 6 && !PyErr_Occurred(); ++i) {
            PyObject *const item = PySequence_GetItem(value, i);
            if (item != NULL) {
                store(item, CODE, (char *)target + i * 4);
                Py_DECREF(item);
            }
        }
    }
}

/* Fill a struct from a dictionary with exactly its fields, or set an exception and return -1. */
static int read_struct(PyObject *dictionary, const field *fields, void *target)
{
    Py_ssize_t n = 0;
    if (!PyDict_Check(dictionary)) {
        PyErr_Format(PyExc_TypeError, "a dictionary expected, %R given", dictionary);
        return -1;
    }
    for (; fields[n].name != NULL; ++n) {
        PyObject *const value = PyMapping_GetItemString(dictionary, fields[n].name);
        if (value == NULL) {
            return -1;
        }
        store(value, fields[n].type, (char *)target + fields[n].offset);
        Py_DECREF(value);
        if (PyErr_Occurred()) {
            return -1;
        }
    }
    if (PyDict_Size(dictionary) != n) {
        PyErr_Format(
            PyExc_ValueError, "%zd fields expected, %zd given", n, PyDict_Size(dictionary));
        return -1;
    }
    return 0;
}

/* Allocate zeros that live as long as the stream; NULL with an exception. */
static void *allocate(stream *s, size_t n, size_t size)
{
    void *const block = PyMem_Calloc(n ? n : 1, size);
    if (block == NULL) {
        PyErr_NoMemory();
    } else {
        s->blocks[s->n_blocks++] = block;
    }
    return block;
}

/* Fill a struct from item i of a list, or set an exception and return -1. */
static int read_item(PyObject *list, size_t i, const field *fields, void *target)
{
    PyObject *const item = PyList_GetItem(list, (Py_ssize_t)i);
    if (item == NULL) { /* a number of an item before, which is any object, cut the list */
        return -1;
    }
    Py_INCREF(item);
    const int result = read_struct(item, fields, target);
    Py_DECREF(item);
    return result;
}

/* Return n structs of a list of dictionaries; NULL with an exception. */
static void *read_structs(stream *s, PyObject *list, size_t n, const field *fields, size_t size)
{
    if ((size_t)PyList_Size(list) != n) {
        PyErr_Format(
            PyExc_ValueError, "%zu dictionaries with the field %s expected, %zd given", n,
            fields[0].name, PyList_Size(list));
        return NULL;
    }
    char *const block = allocate(s, n, size);
    for (size_t i = 0; i < n && block != NULL; ++i) {
        if (read_item(list, i, fields, block + i * size) < 0) {
            return NULL;
        }
    }
    return block;
}

/* Return a copy of n numbers of an array; NULL with an exception. */
static double *read_numbers(stream *s, PyObject *object, const char *name, size_t n)
{
    array a = {0};
    double *copy = NULL;
    if (get_array('d', object, name, 1, PyBUF_SIMPLE, &a) == 0 &&
        check_shape(&a, SHAPE((Py_ssize_t)n)) == 0) {
        copy = allocate(s, n, sizeof(double));
        if (copy != NULL) {
            memcpy(copy, a.data, n * sizeof(double));
        }
    }
    PyBuffer_Release(&a.view);
    return copy;
}

/* Fill the tables of a stream, or set an exception and return -1. */
static int read_tables(stream *s, PyObject *args)
{
    PyObject *hand, *fingers, *features, *lags, *used, *rotations, *positions, *baseline;
    holdfast_hand *const h = &s->hand;
    if (!PyArg_ParseTuple(
            args, "O!O!O!O!OOOO:Stream", &PyDict_Type, &hand, &PyList_Type, &fingers, &PyList_Type,
            &features, &PyList_Type, &lags, &used, &rotations, &positions, &baseline) ||
        read_struct(hand, hand_fields, h) < 0) {
        return -1;
    }
    /* `holdfast_check` has the same limits, but reads the tables; here no product overflows. */
    if (h->n_fingers > HF_MAX_TAXELS || h->n_lanes > HF_MAX_TAXELS ||
        h->n_features > HF_MAX_FEATURES || h->n_lags > HF_MAX_FEATURES) {
        PyErr_SetString(PyExc_ValueError, "n_fingers, n_lanes, n_features or n_lags is too large");
        return -1;
    }
    const size_t n = h->n_fingers;
    if (!(h->fingers = read_structs(s, fingers, n, finger_fields, sizeof *h->fingers)) ||
        !(h->features =
              read_structs(s, features, n * h->n_features, feature_fields, sizeof *h->features)) ||
        !(h->lags = read_structs(s, lags, h->n_lags, lag_fields, sizeof *h->lags)) ||
        !(h->used = read_numbers(s, used, "used", h->n_lanes)) ||
        !(h->rotations = read_numbers(s, rotations, "rotations", 9 * h->n_lanes)) ||
        !(h->positions = read_numbers(s, positions, "positions", 3 * h->n_lanes))) {
        return -1;
    }
    const char *const wrong = holdfast_check(h);
    if (wrong != NULL) {
        PyErr_Format(PyExc_ValueError, "tables that do not fit: %s", wrong);
        return -1;
    }
    for (size_t i = 0; i < n; ++i) {
        s->n_taxels += h->fingers[i].n_taxels;
    }
    void *const block = allocate(s, holdfast_memory_size(h), 1);
    s->present = allocate(s, n, sizeof(bool));
    if (block == NULL || s->present == NULL) {
        return -1;
    }
    holdfast_use_memory(h, &s->memory, block);
    array a = {0};
    int result = get_array('d', baseline, "baseline", 2, PyBUF_SIMPLE, &a);
    if (result == 0) {
        result = check_shape(&a, SHAPE((Py_ssize_t)s->n_taxels, 3));
    }
    if (result == 0) {
        holdfast_begin(h, &s->memory, a.data);
    }
    PyBuffer_Release(&a.view);
    return result;
}

static PyObject *stream_new(PyTypeObject *type, PyObject *args, PyObject *names)
{
    if (names != NULL && PyDict_Size(names) > 0) {
        PyErr_SetString(PyExc_TypeError, "Stream takes no arguments by name");
        return NULL;
    }
    stream *const s = (stream *)PyType_GenericAlloc(type, 0); /* all bytes are 0 */
    if (s != NULL) {
        s->last_time = -DBL_MAX;
        if (read_tables(s, args) < 0) {
            Py_DECREF(s);
            return NULL;
        }
    }
    return (PyObject *)s;
}

static void stream_dealloc(PyObject *self)
{
    stream *const s = (stream *)self;
    PyTypeObject *const type = Py_TYPE(self);
    while (s->n_blocks > 0) {
        PyMem_Free(s->blocks[--s->n_blocks]);
    }
    PyObject_Free(self);
    Py_DECREF(type); /* an object of a heap type owns its type */
}

/* Process n samples, and copy their features and amplitudes. */
static void advance_all(
    stream *s, const array *readings, const array *present, const array *times,
    const array *features, const array *amplitude)
{
    const size_t n = (size_t)times->view.shape[0], n_fingers = s->hand.n_fingers;
    const size_t width = n_fingers * s->hand.n_features;
    const unsigned char *is_present = present->view.buf; /* bytes: any but 0 is true */
    for (size_t k = 0; k < n; ++k) {
        for (size_t f = 0; f < n_fingers; ++f) {
            s->present[f] = *is_present++ != 0;
        }
        holdfast_advance(
            &s->hand, &s->memory, readings->data + 3 * s->n_taxels * k, s->present, times->data[k]);
        memcpy(features->data + width * k, s->memory.features, width * sizeof(double));
        for (size_t f = 0; f < n_fingers; ++f) {
            amplitude->data[n_fingers * k + f] = s->memory.values[f].amplitude;
        }
    }
}

/* Return 0 if each time is finite and later than the one before, else set an exception. */
static int check_times(const array *times, double last)
{
    for (Py_ssize_t k = 0; k < times->view.shape[0]; last = times->data[k++]) {
        if (!(times->data[k] > last && times->data[k] <= DBL_MAX)) {
            PyErr_Format(
                PyExc_ValueError,
                "times: number %zd is not finite, or not later than the one before", k);
            return -1;
        }
    }
    return 0;
}

static PyObject *stream_advance(PyObject *self, PyObject *const *args, Py_ssize_t n_args)
{
    stream *const s = (stream *)self;
    if (check_count(n_args, 5) < 0) {
        return NULL;
    }
    if (s->is_in_use) {
        PyErr_SetString(PyExc_RuntimeError, "another thread is using this stream");
        return NULL;
    }
    s->is_in_use = true; /* before an object that is no array may run Python */
    array arrays[5] = {0}, *const readings = &arrays[0], *const present = &arrays[1];
    array *const times = &arrays[2], *const features = &arrays[3], *const amplitude = &arrays[4];
    PyObject *result = NULL;
    if (get_array('d', args[0], "readings", 3, PyBUF_SIMPLE, readings) < 0 ||
        get_array('?', args[1], "present", 2, PyBUF_SIMPLE, present) < 0 ||
        get_array('d', args[2], "times", 1, PyBUF_SIMPLE, times) < 0 ||
        get_array('d', args[3], "features", 3, PyBUF_WRITABLE, features) < 0 ||
        get_array('d', args[4], "amplitude", 2, PyBUF_WRITABLE, amplitude) < 0) {
        goto done;
    }
    const Py_ssize_t n = times->view.shape[0], n_fingers = (Py_ssize_t)s->hand.n_fingers;
    const Py_ssize_t n_taxels = (Py_ssize_t)s->n_taxels;
    if (check_shape(readings, SHAPE(n, n_taxels, 3)) < 0 ||
        check_shape(present, SHAPE(n, n_fingers)) < 0 ||
        check_shape(features, SHAPE(n, n_fingers, (Py_ssize_t)s->hand.n_features)) < 0 ||
        check_shape(amplitude, SHAPE(n, n_fingers)) < 0 || check_apart(arrays, 5, 2) < 0 ||
        check_times(times, s->last_time) < 0) {
        goto done;
    }
    if (n > 0) {
        s->last_time = times->data[n - 1];
    }
    /* To release the GIL takes longer than a sample. */
    PyThreadState *const released = n > 1 ? PyEval_SaveThread() : NULL;
    advance_all(s, readings, present, times, features, amplitude);
    if (released != NULL) {
        PyEval_RestoreThread(released);
    }
    result = Py_NewRef(Py_None);
done:
    release(arrays, 5);
    s->is_in_use = false;
    return result;
}

/* Pointers to functions of other types go through `void (*)(void)`, as Python's own modules do. */
static PyMethodDef functions[] = {
    {"haar_features", (PyCFunction)(void (*)(void))haar_features, METH_FASTCALL, NULL},
    {"fingertip_force", (PyCFunction)(void (*)(void))fingertip_force, METH_FASTCALL, NULL},
    {"logistic", (PyCFunction)(void (*)(void))logistic, METH_FASTCALL, NULL},
    {"replay", (PyCFunction)(void (*)(void))replay, METH_FASTCALL, NULL},
    {"parse_counts", (PyCFunction)(void (*)(void))parse_counts, METH_FASTCALL, NULL},
    {NULL, NULL, 0, NULL},
};

static PyMethodDef stream_methods[] = {
    {"advance", (PyCFunction)(void (*)(void))stream_advance, METH_FASTCALL, NULL},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot stream_slots[] = {
    {Py_tp_new, SLOT(stream_new)},
    {Py_tp_dealloc, SLOT(stream_dealloc)},
    {Py_tp_methods, stream_methods},
    {0, NULL},
};

static PyType_Spec stream_spec = {
    "holdfast.kernel._extension.Stream", sizeof(stream), 0, Py_TPFLAGS_DEFAULT, stream_slots,
};

#include "module_estimates.c"

#include "module_detector.c"

static int add_contents(PyObject *module)
{
    PyObject *const type = PyType_FromModuleAndSpec(module, &stream_spec, NULL);
    const int result = type == NULL ? -1 : PyModule_AddObjectRef(module, "Stream", type);
    Py_XDECREF(type);
    return result < 0 || add_detector(module) < 0 ||
                   PyModule_AddIntConstant(module, "LANES", HF_LANES) < 0
               ? -1
               : PyModule_AddStringConstant(module, "SOURCES", HOLDFAST_SOURCES);
}

static PyModuleDef_Slot module_slots[] = {
    {Py_mod_exec, SLOT(add_contents)},
    {0, NULL},
};

static struct PyModuleDef module_definition = {
    PyModuleDef_HEAD_INIT, "_extension", NULL, 0, functions, module_slots, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__extension(void)
{
    return PyModuleDef_Init(&module_definition);
}
