/* What the extension modules share: arrays of Python by the buffer protocol, which are checked
 * here, and slots of types and modules. */
#ifndef HF_ARRAYS_H
#define HF_ARRAYS_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <stdint.h>
#include <string.h>

/* An array in C order, and its buffer. */
typedef struct {
    Py_buffer view;
    double *data;     /* the same as view.buf */
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
    Py_ssize_t n_bytes = a->view.itemsize;
    for (int axis = 0; axis < a->view.ndim; ++axis) {
        const Py_ssize_t length = a->view.shape[axis];
        if (length < 0 || (length > 0 && n_bytes > PY_SSIZE_T_MAX / length)) {
            return -1;
        }
        n_bytes *= length;
    }
    return a->view.len == n_bytes ? 0 : -1;
}

/* Fill `a` with the buffer of an object, or set an exception and return -1.
 *
 * The buffer must be contiguous, with `n_axes` axes, of the type 'd', '?', 'i', 'H' or 'b'
 * (float64, bool, int32, uint16 or int8) in this machine's byte order.
 */
static int get_array(char type, PyObject *object, const char *name, int n_axes, int flags, array *a)
{
    const char *const types = "d?iHb", *const found = strchr(types, type);
    const size_t size = ((const size_t[]){8, 1, 4, 2, 1})[found - types];
    a->name = name;
    if (PyObject_GetBuffer(object, &a->view, flags | PyBUF_C_CONTIGUOUS | PyBUF_FORMAT) < 0) {
        return -1;
    }
    const char *format = a->view.format ? a->view.format : "B";
    if (format[0] == '@' || format[0] == '=' || format[0] == (PY_LITTLE_ENDIAN ? '<' : '>')) {
        ++format;
    }
    if (format[0] != type || format[1] != '\0' || a->view.itemsize != (Py_ssize_t)size) {
        PyErr_Format(
            PyExc_TypeError, "%s: %s expected, the format %s given", name,
            ((const char *[]){"float64", "bool", "int32", "uint16", "int8"})[found - types],
            format);
        return -1;
    }
    if (a->view.ndim != n_axes || a->view.shape == NULL) {
        PyErr_Format(
            PyExc_ValueError, "%s: %d axes expected, %d given", name, n_axes, a->view.ndim);
        return -1;
    }
    if (check_size(a) < 0) {
        PyErr_Format(PyExc_ValueError, "%s: a buffer of another size than its shape", name);
        return -1;
    }
    if ((uintptr_t)a->view.buf % size != 0) {
        PyErr_Format(PyExc_ValueError, "%s: its numbers are not aligned in memory", name);
        return -1;
    }
    a->data = a->view.buf;
    return 0;
}

/* Return 0 if an array has this shape, else set an exception and return -1. */
static int check_shape(const array *a, const Py_ssize_t *expected)
{
    for (int axis = 0; axis < a->view.ndim; ++axis) {
        if (a->view.shape[axis] != expected[axis]) {
            PyErr_Format(
                PyExc_ValueError, "%s: axis %d has the length %zd, %zd expected", a->name, axis,
                a->view.shape[axis], expected[axis]);
            return -1;
        }
    }
    return 0;
}
#define SHAPE(...) ((const Py_ssize_t[]){__VA_ARGS__})

/* ISO C has no cast from a function to an object pointer; every compiler of Python has one. */
#if defined(__GNUC__)
#define SLOT(function) (__extension__(void *)(function))
#else
#define SLOT(function) ((void *)(function))
#endif

#endif
