/* The extension module: Python objects in, C pointers out, no arithmetic.
 *
 * Only the limited API of Python 3.11 is used, so that one build serves all later versions.
 * Arrays come in by the buffer protocol and are checked here: type, shape, order in memory. The
 * C functions trust their arguments. While they run, the GIL is released: the buffers cannot go
 * away, but a caller who changes the numbers in another thread gets either of them.
 */
#include <Python.h>

#include "batch.h"

/* The size of the scratch memory of a longer window could overflow. */
#define MAX_WINDOW (PY_SSIZE_T_MAX / 1024)

/* An array of float64 in C order, and its buffer. */
typedef struct {
    Py_buffer view;
    double *data;
    const char *name; /* in messages */
} array;

static void release(array *arrays, size_t n)
{
    for (size_t i = 0; i < n; ++i) {
        PyBuffer_Release(&arrays[i].view); /* does nothing if there is no buffer */
    }
}

/* Return 0 if the buffer of an array has exactly the bytes that its shape says. */
static int check_size(const array *a)
{
    Py_ssize_t n_bytes = (Py_ssize_t)sizeof(double);
    int empty = 0;
    for (int axis = 0; axis < a->view.ndim; ++axis) {
        empty |= a->view.shape[axis] == 0;
    }
    for (int axis = 0; axis < a->view.ndim && !empty; ++axis) {
        if (a->view.shape[axis] < 0 || n_bytes > PY_SSIZE_T_MAX / a->view.shape[axis]) {
            return -1;
        }
        n_bytes *= a->view.shape[axis];
    }
    return a->view.len == (empty ? 0 : n_bytes) ? 0 : -1;
}

/* Fill `a` with the buffer of an object, or set an exception and return -1.
 *
 * The buffer must be float64 of this machine's byte order, contiguous, with `n_axes` axes.
 */
static int get_array(PyObject *object, const char *name, int n_axes, int flags, array *a)
{
    a->name = name;
    if (PyObject_GetBuffer(object, &a->view, flags | PyBUF_C_CONTIGUOUS | PyBUF_FORMAT) < 0) {
        return -1;
    }
    const char *format = a->view.format ? a->view.format : "B";
    if (format[0] == '@' || format[0] == '=' || format[0] == (PY_LITTLE_ENDIAN ? '<' : '>')) {
        ++format;
    }
    if (format[0] != 'd' || format[1] != '\0' || a->view.itemsize != (Py_ssize_t)sizeof(double)) {
        PyErr_Format(PyExc_TypeError, "%s: float64 expected, the format %s given", name, format);
        return -1;
    }
    if (a->view.ndim != n_axes || a->view.shape == NULL) {
        PyErr_Format(PyExc_ValueError, "%s: %d axes expected, %d given", name, n_axes,
                     a->view.ndim);
        return -1;
    }
    if (check_size(a) < 0 || (uintptr_t)a->view.buf % sizeof(double) != 0) {
        PyErr_Format(PyExc_ValueError, "%s: its numbers are not aligned in memory", name);
        return -1;
    }
    a->data = a->view.buf;
    return 0;
}

/* Return 0 if an axis has this length, else set an exception and return -1. */
static int check_axis(const array *a, int axis, Py_ssize_t expected)
{
    if (a->view.shape[axis] == expected) {
        return 0;
    }
    PyErr_Format(PyExc_ValueError, "%s: axis %d has the length %zd, %zd expected", a->name, axis,
                 a->view.shape[axis], expected);
    return -1;
}

/* Return 0 if two arrays share no memory, else set an exception and return -1. */
static int check_apart(const array *a, const array *out)
{
    const char *const start = a->view.buf, *const out_start = out->view.buf;
    if (start + a->view.len <= out_start || out_start + out->view.len <= start) {
        return 0;
    }
    PyErr_Format(PyExc_ValueError, "%s and %s share memory", a->name, out->name);
    return -1;
}

static int check_count(Py_ssize_t n_args, Py_ssize_t expected)
{
    if (n_args == expected) {
        return 0;
    }
    PyErr_Format(PyExc_TypeError, "%zd arguments expected, %zd given", expected, n_args);
    return -1;
}

static PyObject *haar_features(PyObject *module, PyObject *const *args, Py_ssize_t n_args)
{
    (void)module;
    if (check_count(n_args, 5) < 0) {
        return NULL;
    }
    const Py_ssize_t window = PyLong_AsSsize_t(args[1]);
    const Py_ssize_t first = PyLong_AsSsize_t(args[2]);
    const Py_ssize_t stop = PyLong_AsSsize_t(args[3]);
    if (PyErr_Occurred()) {
        return NULL;
    }
    array arrays[2] = {0}, *const force = &arrays[0], *const out = &arrays[1];
    double *scratch = NULL;
    PyObject *result = NULL;
    if (get_array(args[0], "force", 2, PyBUF_SIMPLE, force) < 0 ||
        get_array(args[4], "out", 2, PyBUF_WRITABLE, out) < 0 || check_axis(force, 1, 3) < 0 ||
        check_axis(out, 0, force->view.shape[0]) < 0 ||
        check_axis(out, 1, HOLDFAST_N_FEATURES) < 0 || check_apart(force, out) < 0) {
        goto done;
    }
    const Py_ssize_t n = force->view.shape[0];
    if (window < 2 || window % 2 || first < 0 || first > stop || stop > n) {
        PyErr_Format(PyExc_ValueError, "window %zd, samples %zd to %zd of %zd given", window, first,
                     stop, n);
        goto done;
    }
    if (window <= n) { /* a longer one has no sample with features, and no scratch memory */
        if (window < MAX_WINDOW) {
            scratch = PyMem_Malloc(holdfast_haar_scratch((size_t)window) * sizeof(double));
        }
        if (scratch == NULL) {
            PyErr_NoMemory();
            goto done;
        }
    }
    Py_BEGIN_ALLOW_THREADS
    holdfast_haar_features(force->data, (size_t)window, (size_t)first, (size_t)stop, out->data,
                           scratch);
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
done:
    PyMem_Free(scratch);
    release(arrays, 2);
    return result;
}

static PyObject *fingertip_force(PyObject *module, PyObject *const *args, Py_ssize_t n_args)
{
    (void)module;
    if (check_count(n_args, 6) < 0) {
        return NULL;
    }
    const Py_ssize_t first = PyLong_AsSsize_t(args[3]);
    const Py_ssize_t stop = PyLong_AsSsize_t(args[4]);
    if (PyErr_Occurred()) {
        return NULL;
    }
    array arrays[4] = {0}, *const readings = &arrays[0], *const baseline = &arrays[1];
    array *const rotations = &arrays[2], *const out = &arrays[3];
    PyObject *result = NULL;
    if (get_array(args[0], "readings", 3, PyBUF_SIMPLE, readings) < 0 ||
        get_array(args[1], "baseline", 2, PyBUF_SIMPLE, baseline) < 0 ||
        get_array(args[2], "rotations", 3, PyBUF_SIMPLE, rotations) < 0 ||
        get_array(args[5], "out", 2, PyBUF_WRITABLE, out) < 0) {
        goto done;
    }
    const Py_ssize_t n = readings->view.shape[0], n_taxels = readings->view.shape[1];
    if (check_axis(readings, 2, 3) < 0 || check_axis(baseline, 0, n_taxels) < 0 ||
        check_axis(baseline, 1, 3) < 0 || check_axis(rotations, 0, n_taxels) < 0 ||
        check_axis(rotations, 1, 3) < 0 || check_axis(rotations, 2, 3) < 0 ||
        check_axis(out, 0, n) < 0 || check_axis(out, 1, 3) < 0 || check_apart(readings, out) < 0 ||
        check_apart(baseline, out) < 0 || check_apart(rotations, out) < 0) {
        goto done;
    }
    if (first < 0 || first > stop || stop > n) {
        PyErr_Format(PyExc_ValueError, "samples %zd to %zd of %zd given", first, stop, n);
        goto done;
    }
    Py_BEGIN_ALLOW_THREADS
    holdfast_fingertip_force(readings->data + 3 * n_taxels * first, baseline->data,
                             rotations->data, (size_t)(stop - first), (size_t)n_taxels,
                             out->data + 3 * first);
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
done:
    release(arrays, 4);
    return result;
}

/* Pointers to functions of other types go through `void (*)(void)`, as Python's own modules do. */
#define FUNCTION(name) {#name, (PyCFunction)(void (*)(void))name, METH_FASTCALL, NULL}

static PyMethodDef functions[] = {
    FUNCTION(haar_features),
    FUNCTION(fingertip_force),
    {NULL, NULL, 0, NULL},
};

static int add_constants(PyObject *module)
{
    return PyModule_AddStringConstant(module, "SOURCES", HOLDFAST_SOURCES);
}

/* ISO C has no cast from a function to an object pointer; every compiler of Python has one. */
#if defined(__GNUC__)
#define SLOT(function) (__extension__(void *)(function))
#else
#define SLOT(function) ((void *)(function))
#endif

static PyModuleDef_Slot module_slots[] = {
    {Py_mod_exec, SLOT(add_constants)},
    {0, NULL},
};

static struct PyModuleDef module_definition = {
    PyModuleDef_HEAD_INIT, "_extension", NULL, 0, functions, module_slots, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__extension(void);

PyMODINIT_FUNC PyInit__extension(void)
{
    return PyModuleDef_Init(&module_definition);
}
