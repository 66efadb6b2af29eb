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
#include "holdfast.h"
#include "finger.h"

/* A function of the kernel; that of module_avx2.c where the processor has AVX2. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
extern __typeof__(holdfast_advance) *const holdfast_advance_avx2;
extern __typeof__(holdfast_detect) *const holdfast_detect_avx2;
#define WIDEST(function) (__builtin_cpu_supports("avx2") ? function##_avx2 : function)
#else
#define WIDEST(function) function
#endif

/* The size of the scratch memory of a longer window, ten rows of doubles, could overflow. */
#define MAX_WINDOW (PY_SSIZE_T_MAX / 1024)

/* Axes of the arrays that a function takes. Lengths below 0 are those of the first such array. */
enum { N = 1, FINGERS, TAXELS, FEATURES, COLUMNS, AXES, MATRIX_ROWS, N_AXES };
#define LENGTHS(...)                                                                               \
    {                                                                                              \
        [N] = -1, [AXES] = 3, [MATRIX_ROWS] = 3, __VA_ARGS__                                       \
    }
enum { MAX_ARRAYS = 5 };

/* What a function expects of an argument that is an array. */
typedef struct {
    char type; /* see get_array */
    bool is_out;
    const char *name;
    int axes[3]; /* 0 from the last one on */
} parameter;

/* Return 0 if array i shares no memory with those before it, else set an exception. */
static int check_apart(const array *arrays, size_t i)
{
    const char *const out = arrays[i].view.buf;
    for (size_t j = 0; j < i; ++j) {
        const char *const other = arrays[j].view.buf;
        if (other + arrays[j].view.len > out && out + arrays[i].view.len > other) {
            PyErr_Format(
                PyExc_ValueError, "%s and %s share memory", arrays[j].name, arrays[i].name);
            return -1;
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

/* Take the arrays of all arguments, which fit each other, or set an exception and return -1.
 *
 * Arrays that are written stand last, and share no memory with others. */
static int read_arrays(
    PyObject *const *args, Py_ssize_t n_args, const parameter *expected, size_t n,
    Py_ssize_t *lengths, array *arrays)
{
    if (check_count(n_args, (Py_ssize_t)n) < 0) {
        return -1;
    }
    for (size_t i = 0; i < n; ++i) {
        const int *const axes = expected[i].axes;
        const int n_axes = !axes[1] ? 1 : !axes[2] ? 2 : 3;
        const int flags = expected[i].is_out ? PyBUF_WRITABLE : PyBUF_SIMPLE;
        if (get_array(expected[i].type, args[i], expected[i].name, n_axes, flags, &arrays[i]) < 0) {
            return -1;
        }
    }
    for (size_t i = 0; i < n; ++i) {
        Py_ssize_t shape[3];
        for (int axis = 0; axis < arrays[i].view.ndim; ++axis) {
            Py_ssize_t *const length = &lengths[expected[i].axes[axis]];
            shape[axis] = *length = *length < 0 ? arrays[i].view.shape[axis] : *length;
        }
        if (check_shape(&arrays[i], shape) < 0) {
            return -1;
        }
        if (expected[i].is_out && check_apart(arrays, i) < 0) {
            return -1;
        }
    }
    return 0;
}

#include "module_batch.c"

enum { N_STREAM_PARTS = 8, MAX_BLOCKS = 8 };

/* A feature stream of a hand: its constants, its memory, and who uses it. */
typedef struct {
    PyObject_HEAD
    holdfast_hand hand; /* its tables are the bytes of `parts` */
    holdfast_memory memory;
    PyObject *parts[N_STREAM_PARTS]; /* bytes, which nothing can change */
    void *blocks[MAX_BLOCKS];        /* that live as long as the stream */
    size_t n_blocks;
    bool *present;    /* (n_fingers) of one sample */
    size_t n_taxels;  /* of all fingers */
    double last_time; /* of the newest sample [s] */
    bool is_in_use;   /* a call is running */
    const char *noun; /* in messages */
} stream;

/* Allocate zeros that live as long as the stream; NULL with an exception. */
static void *allocate(stream *s, size_t n, size_t size)
{
    if (s->n_blocks == MAX_BLOCKS) {
        PyErr_SetString(PyExc_SystemError, "more blocks than a stream keeps");
        return NULL;
    }
    void *const block = PyMem_Calloc(n ? n : 1, size);
    if (block == NULL) {
        PyErr_NoMemory();
    } else {
        s->blocks[s->n_blocks++] = block;
    }
    return block;
}

/* Return the n structs, or numbers, that bytes are; NULL with an exception. */
static const void *from_bytes(PyObject *bytes, const char *name, size_t n, size_t size)
{
    if (!PyBytes_Check(bytes)) {
        PyErr_Format(PyExc_TypeError, "%s: bytes expected, %R given", name, bytes);
        return NULL;
    }
    if ((size_t)PyBytes_Size(bytes) != n * size) {
        PyErr_Format(
            PyExc_ValueError, "%s: %zu bytes expected, %zd given", name, n * size,
            PyBytes_Size(bytes));
        return NULL;
    }
    const char *const data = PyBytes_AsString(bytes);
    if ((uintptr_t)data % sizeof(double) != 0) {
        PyErr_Format(PyExc_ValueError, "%s: bytes that are not aligned", name);
        return NULL;
    }
    return data;
}

static int refuse_config(const char *wrong)
{
    if (wrong == NULL) {
        return 0;
    }
    PyErr_Format(PyExc_ValueError, "constants that do not fit: %s", wrong);
    return -1;
}

/* Take the constants of a stream and its baseline, begin it, or set an exception and return -1. */
static int begin_stream(stream *s, PyObject *const *args, const char *noun)
{
    holdfast_hand *const h = &s->hand;
    const void *const hand = from_bytes(args[0], "hand", 1, sizeof *h);
    if (hand == NULL) {
        return -1;
    }
    memcpy(h, hand, sizeof *h);
    /* `holdfast_check` has the same limits, but reads the tables; here no product overflows. */
    if (h->n_fingers > HF_MAX_TAXELS || h->n_lanes > HF_MAX_TAXELS ||
        h->n_features > HF_MAX_FEATURES || h->n_lags > HF_MAX_FEATURES) {
        PyErr_SetString(PyExc_ValueError, "n_fingers, n_lanes, n_features or n_lags is too large");
        return -1;
    }
    const size_t n = h->n_fingers, n_features = n * h->n_features, width = sizeof(double);
    if (!(h->fingers = from_bytes(args[1], "fingers", n, sizeof *h->fingers)) ||
        !(h->features = from_bytes(args[2], "features", n_features, sizeof *h->features)) ||
        !(h->lags = from_bytes(args[3], "lags", h->n_lags, sizeof *h->lags)) ||
        !(h->used = from_bytes(args[4], "used", h->n_lanes, width)) ||
        !(h->rotations = from_bytes(args[5], "rotations", 9 * h->n_lanes, width)) ||
        !(h->positions = from_bytes(args[6], "positions", 3 * h->n_lanes, width)) ||
        refuse_config(holdfast_check(h)) < 0) {
        return -1;
    }
    for (size_t i = 0; i < N_STREAM_PARTS; ++i) {
        s->parts[i] = Py_NewRef(args[i]);
    }
    for (size_t i = 0; i < n; ++i) {
        s->n_taxels += h->fingers[i].n_taxels;
    }
    const double *const baseline = from_bytes(args[7], "baseline", 3 * s->n_taxels, width);
    void *const block = baseline ? allocate(s, holdfast_memory_size(h), 1) : NULL;
    s->present = block ? allocate(s, n, sizeof(bool)) : NULL;
    if (s->present == NULL) {
        return -1;
    }
    holdfast_use_memory(h, &s->memory, block);
    holdfast_begin(h, &s->memory, baseline);
    s->last_time = -INFINITY;
    s->noun = noun;
    return 0;
}

/* Return the arguments of a type; NULL with an exception for another number, or for names. */
static PyObject *const *read_arguments(
    PyObject *args, PyObject *names, Py_ssize_t n, PyObject **items)
{
    if (names != NULL && PyDict_Size(names) > 0) {
        PyErr_SetString(PyExc_TypeError, "no arguments by name expected");
        return NULL;
    }
    if (check_count(PyTuple_Size(args), n) < 0) {
        return NULL;
    }
    for (Py_ssize_t i = 0; i < n; ++i) {
        items[i] = PyTuple_GetItem(args, i);
    }
    return items;
}

static PyObject *stream_new(PyTypeObject *type, PyObject *args, PyObject *names)
{
    PyObject *items[N_STREAM_PARTS];
    if (read_arguments(args, names, N_STREAM_PARTS, items) == NULL) {
        return NULL;
    }
    stream *const s = (stream *)PyType_GenericAlloc(type, 0); /* all bytes are 0 */
    if (s != NULL && begin_stream(s, items, "stream") < 0) {
        Py_DECREF(s);
        return NULL;
    }
    return (PyObject *)s;
}

static void free_stream(stream *s)
{
    while (s->n_blocks > 0) {
        PyMem_Free(s->blocks[--s->n_blocks]);
    }
    for (size_t i = 0; i < N_STREAM_PARTS; ++i) {
        Py_XDECREF(s->parts[i]);
    }
}

static void stream_dealloc(PyObject *self)
{
    stream *const s = (stream *)self;
    PyTypeObject *const type = Py_TYPE(self);
    free_stream(s);
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
        WIDEST(holdfast_advance)(
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

/* Let a stream be used by this call alone, or set an exception and return -1: what its arguments
 * run, or another thread while the GIL is released, may call it. */
static int begin_use(stream *s)
{
    if (s->is_in_use) {
        PyErr_Format(PyExc_RuntimeError, "another thread is using this %s", s->noun);
        return -1;
    }
    s->is_in_use = true;
    return 0;
}

/* advance(readings, present, times, features, amplitude): process n samples. */
static PyObject *stream_advance(PyObject *self, PyObject *const *args, Py_ssize_t n_args)
{
    static const parameter expected[] = {
        {'d', false, "readings", {N, TAXELS, AXES}},
        {'?', false, "present", {N, FINGERS}},
        {'d', false, "times", {N}},
        {'d', true, "features", {N, FINGERS, FEATURES}},
        {'d', true, "amplitude", {N, FINGERS}},
    };
    stream *const s = (stream *)self;
    if (begin_use(s) < 0) {
        return NULL;
    }
    Py_ssize_t lengths[N_AXES] = LENGTHS(
        [FINGERS] = (Py_ssize_t)s->hand.n_fingers, [TAXELS] = (Py_ssize_t)s->n_taxels,
        [FEATURES] = (Py_ssize_t)s->hand.n_features);
    array arrays[MAX_ARRAYS] = {0}, *const times = &arrays[2];
    PyObject *result = NULL;
    if (read_arrays(args, n_args, expected, 5, lengths, arrays) == 0 &&
        check_times(times, s->last_time) == 0) {
        s->last_time = lengths[N] > 0 ? times->data[lengths[N] - 1] : s->last_time;
        /* To release the GIL takes longer than a sample. */
        PyThreadState *const released = lengths[N] > 1 ? PyEval_SaveThread() : NULL;
        advance_all(s, &arrays[0], &arrays[1], times, &arrays[3], &arrays[4]);
        if (released != NULL) {
            PyEval_RestoreThread(released);
        }
        result = Py_NewRef(Py_None);
    }
    release(arrays, MAX_ARRAYS);
    s->is_in_use = false;
    return result;
}

/* Pointers to functions of other types go through `void (*)(void)`, as Python's own modules do. */
#define METHOD(name, function)                                                                     \
    {                                                                                              \
#name, (PyCFunction)(void (*)(void))(function), METH_FASTCALL, NULL                        \
    }
static PyMethodDef functions[] = {
    METHOD(haar_features, haar_features),
    METHOD(fingertip_force, fingertip_force),
    METHOD(logistic, logistic),
    METHOD(replay, replay),
    {NULL, NULL, 0, NULL},
};

static PyMethodDef stream_methods[] = {
    METHOD(advance, stream_advance),
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

#include "module_detector.c"

/* Constants that Python shares. */
static int add_constants(PyObject *module)
{
    static const struct {
        const char *name;
        long value;
    } codes[] = {
        {"LANES", HF_LANES},
        {"N_COMPONENTS", HF_N_COMPONENTS},
        {"ALWAYS_CONTACT", HOLDFAST_ALWAYS_CONTACT},
        {"CONTACT_BY_FORCE", HOLDFAST_CONTACT_BY_FORCE},
        {"CONTACT_BY_NOISE", HOLDFAST_CONTACT_BY_NOISE},
        {"CONTACT_BY_LOAD", HOLDFAST_CONTACT_BY_LOAD},
    };
    static const struct {
        const char *name;
        double value;
    } numbers[] = {
        {"GAP_LIMIT_PERIODS", HF_GAP_LIMIT_PERIODS},
        {"MAX_BRIDGED_SECONDS", HF_MAX_BRIDGED_SECONDS},
        {"MAX_DEVIATION", HF_MAX_DEVIATION},
    };
    for (size_t i = 0; i < sizeof codes / sizeof *codes; ++i) {
        if (PyModule_AddIntConstant(module, codes[i].name, codes[i].value) < 0) {
            return -1;
        }
    }
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; ++i) {
        PyObject *const number = PyFloat_FromDouble(numbers[i].value);
        const int result = number ? PyModule_AddObjectRef(module, numbers[i].name, number) : -1;
        Py_XDECREF(number);
        if (result < 0) {
            return -1;
        }
    }
    return 0;
}

static int add_type(PyObject *module, const char *name, PyType_Spec *spec)
{
    PyObject *const type = PyType_FromModuleAndSpec(module, spec, NULL);
    const int result = type ? PyModule_AddObjectRef(module, name, type) : -1;
    Py_XDECREF(type);
    return result;
}

static int add_contents(PyObject *module)
{
    if (add_type(module, "Stream", &stream_spec) < 0 ||
        add_type(module, "Detector", &detector_spec) < 0 ||
        add_type(module, "Estimates", &estimates_spec) < 0 || add_constants(module) < 0) {
        return -1;
    }
    return PyModule_AddStringConstant(module, "SOURCES", HOLDFAST_SOURCES);
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
