/* The extension module: Python objects in, C pointers out, no arithmetic.
 *
 * Only the limited API of Python 3.11 is used, so that one build serves all later versions.
 */
#include <Python.h>

static int add_constants(PyObject *module)
{
    return PyModule_AddStringConstant(module, "SOURCES", HOLDFAST_SOURCES);
}

/* C has no cast from a function to an object pointer; every compiler of Python has one. */
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
    PyModuleDef_HEAD_INIT, "_extension", NULL, 0, NULL, module_slots, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__extension(void);

PyMODINIT_FUNC PyInit__extension(void)
{
    return PyModuleDef_Init(&module_definition);
}
