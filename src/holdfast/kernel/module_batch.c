/* Functions of whole arrays of the extension module: a part of module.c, which includes it. */

/* Read two integers from..to of n samples, or set an exception and return -1. */
static int read_range(PyObject *const *args, Py_ssize_t n, Py_ssize_t *first, Py_ssize_t *stop)
{
    *first = PyLong_AsSsize_t(args[0]);
    *stop = PyLong_AsSsize_t(args[1]);
    if (PyErr_Occurred()) {
        return -1;
    }
    if (*first < 0 || *first > *stop || *stop > n) {
        PyErr_Format(PyExc_ValueError, "samples %zd to %zd of %zd given", *first, *stop, n);
        return -1;
    }
    return 0;
}

/* haar_features(force, out, first, stop, window): fill rows first to stop of `out`. */
static PyObject *haar_features(
    PyObject *Py_UNUSED(module), PyObject *const *args, Py_ssize_t n_args)
{
    static const parameter expected[] = {
        {'d', false, "force", {N, AXES}}, {'d', true, "out", {N, COLUMNS}}};
    Py_ssize_t lengths[N_AXES] = LENGTHS([COLUMNS] = HOLDFAST_N_HAAR), first, stop;
    array arrays[2] = {0};
    double *scratch = NULL;
    PyObject *result = NULL;
    if (check_count(n_args, 5) < 0 || read_arrays(args, 2, expected, 2, lengths, arrays) < 0 ||
        read_range(args + 2, lengths[N], &first, &stop) < 0) {
        goto done;
    }
    const Py_ssize_t window = PyLong_AsSsize_t(args[4]);
    if (window < 2 || window % 2) {
        if (!PyErr_Occurred()) {
            PyErr_Format(PyExc_ValueError, "window %zd given", window);
        }
        goto done;
    }
    /* A longer window has no sample with features, and no scratch memory. */
    if (window <= lengths[N]) {
        if (window < MAX_WINDOW) {
            scratch = PyMem_Malloc(holdfast_haar_scratch((size_t)window) * sizeof(double));
        }
        if (scratch == NULL) {
            PyErr_NoMemory();
            goto done;
        }
    }
    Py_BEGIN_ALLOW_THREADS
    holdfast_haar_features(
        arrays[0].data, (size_t)window, (size_t)first, (size_t)stop, arrays[1].data, scratch);
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
done:
    PyMem_Free(scratch);
    release(arrays, 2);
    return result;
}

/* fingertip_force(readings, baseline, rotations, out, first, stop) */
static PyObject *fingertip_force(
    PyObject *Py_UNUSED(module), PyObject *const *args, Py_ssize_t n_args)
{
    static const parameter expected[] = {
        {'d', false, "readings", {N, TAXELS, AXES}},
        {'d', false, "baseline", {TAXELS, AXES}},
        {'d', false, "rotations", {TAXELS, MATRIX_ROWS, AXES}},
        {'d', true, "out", {N, AXES}},
    };
    Py_ssize_t lengths[N_AXES] = LENGTHS([TAXELS] = -1), first, stop;
    array arrays[4] = {0};
    PyObject *result = NULL;
    if (check_count(n_args, 6) == 0 && read_arrays(args, 4, expected, 4, lengths, arrays) == 0 &&
        read_range(args + 4, lengths[N], &first, &stop) == 0) {
        Py_BEGIN_ALLOW_THREADS
        holdfast_fingertip_force(
            arrays[0].data + 3 * lengths[TAXELS] * first, arrays[1].data, arrays[2].data,
            (size_t)(stop - first), (size_t)lengths[TAXELS], arrays[3].data + 3 * first);
        Py_END_ALLOW_THREADS
        result = Py_NewRef(Py_None);
    }
    release(arrays, 4);
    return result;
}

/* logistic(values): replace log odds by probabilities. */
static PyObject *logistic(PyObject *Py_UNUSED(module), PyObject *const *args, Py_ssize_t n_args)
{
    static const parameter expected[] = {{'d', true, "values", {N}}};
    Py_ssize_t lengths[N_AXES] = LENGTHS([COLUMNS] = 0);
    array values = {0};
    PyObject *result = NULL;
    if (read_arrays(args, n_args, expected, 1, lengths, &values) == 0) {
        Py_BEGIN_ALLOW_THREADS
        holdfast_logistic(values.data, (size_t)lengths[N]);
        Py_END_ALLOW_THREADS
        result = Py_NewRef(Py_None);
    }
    release(&values, 1);
    return result;
}

/* replay(times, probability, raw, limits, out): the states of a finger with other limits. */
static PyObject *replay(PyObject *Py_UNUSED(module), PyObject *const *args, Py_ssize_t n_args)
{
    static const parameter expected[] = {
        {'d', false, "times", {N}}, {'d', false, "probability", {N}},
        {'b', false, "raw", {N}},   {'d', false, "limits", {COLUMNS}},
        {'b', true, "out", {N}},
    };
    Py_ssize_t lengths[N_AXES] = LENGTHS([COLUMNS] = HOLDFAST_N_LIMITS);
    array a[MAX_ARRAYS] = {0};
    PyObject *result = NULL;
    if (read_arrays(args, n_args, expected, MAX_ARRAYS, lengths, a) == 0) {
        Py_BEGIN_ALLOW_THREADS
        holdfast_replay(
            a[0].data, a[1].data, a[2].view.buf, (size_t)lengths[N], a[3].data, a[4].view.buf);
        Py_END_ALLOW_THREADS
        result = Py_NewRef(Py_None);
    }
    release(a, MAX_ARRAYS);
    return result;
}
