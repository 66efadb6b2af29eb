/* The kernel and the detector as one source file: their functions are static, and compilers see all
 * of them. An exported header joins the same files in this order. */
#ifndef HF_SHARED
#define HF_SHARED static
#endif

#include "holdfast.h"

#include "finger.h"

#include "taxels.c"
#include "window.c"

#include "faults.c"
#include "laws.c"
#include "implausible.c"
#include "tare.c"
#include "field.c"
#include "masks.c"
#include "motion.c"
#include "sliding.c"
#include "stream.c"
#include "tables.c"

#include "contact.c"
#include "heads.c"

#include "decision.c"

#include "detector.c"
