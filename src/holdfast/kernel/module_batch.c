/* Functions of whole arrays of the extension module: a part of module.c, which includes it. */

static PyObject *haar_features(
    PyObject *Py_UNUSED(module), PyObject *const *args, Py_ssize_t n_args)
{
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
    if (get_array('d', args[0], "force", 2, PyBUF_SIMPLE, force) < 0 ||
        get_array('d', args[4], "out", 2, PyBUF_WRITABLE, out) < 0) {
        goto done;
    }
    const Py_ssize_t n = force->view.shape[0];
    if (check_shape(force, SHAPE(n, 3)) < 0 || check_shape(out, SHAPE(n, HOLDFAST_N_HAAR)) < 0 ||
        check_apart(arrays, 2, 1) < 0) {
        goto done;
    }
    if (window < 2 || window % 2 || first < 0 || first > stop || stop > n) {
        PyErr_Format(
            PyExc_ValueError, "window %zd, samples %zd to %zd of %zd given", window, first, stop,
            n);
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
    holdfast_haar_features(
        force->data, (size_t)window, (size_t)first, (size_t)stop, out->data, scratch);
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
done:
    PyMem_Free(scratch);
    release(arrays, 2);
    return result;
}

static PyObject *fingertip_force(
    PyObject *Py_UNUSED(module), PyObject *const *args, Py_ssize_t n_args)
{
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
    if (get_array('d', args[0], "readings", 3, PyBUF_SIMPLE, readings) < 0 ||
        get_array('d', args[1], "baseline", 2, PyBUF_SIMPLE, baseline) < 0 ||
        get_array('d', args[2], "rotations", 3, PyBUF_SIMPLE, rotations) < 0 ||
        get_array('d', args[5], "out", 2, PyBUF_WRITABLE, out) < 0) {
        goto done;
    }
    const Py_ssize_t n = readings->view.shape[0], n_taxels = readings->view.shape[1];
    if (check_shape(readings, SHAPE(n, n_taxels, 3)) < 0 ||
        check_shape(baseline, SHAPE(n_taxels, 3)) < 0 ||
        check_shape(rotations, SHAPE(n_taxels, 3, 3)) < 0 || check_shape(out, SHAPE(n, 3)) < 0 ||
        check_apart(arrays, 4, 1) < 0) {
        goto done;
    }
    if (first < 0 || first > stop || stop > n) {
        PyErr_Format(PyExc_ValueError, "samples %zd to %zd of %zd given", first, stop, n);
        goto done;
    }
    Py_BEGIN_ALLOW_THREADS
    holdfast_fingertip_force(
        readings->data + 3 * n_taxels * first, baseline->data, rotations->data,
        (size_t)(stop - first), (size_t)n_taxels, out->data + 3 * first);
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
done:
    release(arrays, 4);
    return result;
}

/* logistic(values): replace log odds by probabilities. */
static PyObject *logistic(PyObject *Py_UNUSED(module), PyObject *const *args, Py_ssize_t n_args)
{
    array values = {0};
    PyObject *result = NULL;
    if (check_count(n_args, 1) == 0 &&
        get_array('d', args[0], "values", 1, PyBUF_WRITABLE, &values) == 0) {
        const size_t n = (size_t)values.view.shape[0];
        Py_BEGIN_ALLOW_THREADS
        holdfast_logistic(values.data, n);
        Py_END_ALLOW_THREADS
        result = Py_NewRef(Py_None);
    }
    PyBuffer_Release(&values.view);
    return result;
}

/* replay(times, probability, raw, limits, out): the states of a finger with other limits. */
static PyObject *replay(PyObject *Py_UNUSED(module), PyObject *const *args, Py_ssize_t n_args)
{
    if (check_count(n_args, 5) < 0) {
        return NULL;
    }
    array arrays[5] = {0}, *const times = &arrays[0], *const probability = &arrays[1];
    array *const raw = &arrays[2], *const limits = &arrays[3], *const out = &arrays[4];
    PyObject *result = NULL;
    if (get_array('d', args[0], "times", 1, PyBUF_SIMPLE, times) < 0 ||
        get_array('d', args[1], "probability", 1, PyBUF_SIMPLE, probability) < 0 ||
        get_array('b', args[2], "raw", 1, PyBUF_SIMPLE, raw) < 0 ||
        get_array('d', args[3], "limits", 1, PyBUF_SIMPLE, limits) < 0 ||
        get_array('b', args[4], "out", 1, PyBUF_WRITABLE, out) < 0) {
        goto done;
    }
    const Py_ssize_t n = times->view.shape[0];
    if (check_shape(probability, SHAPE(n)) < 0 || check_shape(raw, SHAPE(n)) < 0 ||
        check_shape(limits, SHAPE(HOLDFAST_N_LIMITS)) < 0 || check_shape(out, SHAPE(n)) < 0 ||
        check_apart(arrays, 5, 1) < 0) {
        goto done;
    }
    Py_BEGIN_ALLOW_THREADS
    holdfast_replay(
        times->data, probability->data, raw->view.buf, (size_t)n, limits->data, out->view.buf);
    Py_END_ALLOW_THREADS
    result = Py_NewRef(Py_None);
done:
    release(arrays, 5);
    return result;
}
