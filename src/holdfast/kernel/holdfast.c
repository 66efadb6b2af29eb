/* The kernel and the detector as one source file; see kernel.c. */
#ifndef HF_SHARED
#define HF_SHARED static
#endif

#include "detector.h"

#include "kernel.c"

#include "contact.c"
#include "heads.c"

#include "decision.c"

#include "detector.c"
