/* The steps as one source file: all functions are static, and compilers see all of them. */
#include "steps.h"

#include "shapes.c"
#include "skin.c"

#include "contact.c" /* and coupled.c */
#include "hand.c"

#include "control.c"
#include "grasp.c"
#include "operator.c"
#include "physics.c"
#include "uskin_readout.c"
