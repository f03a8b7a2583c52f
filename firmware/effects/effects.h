/* The effects of this image: their headers. Each effect NAME supplies
 *
 *   struct NAME           its state, a member of struct controller; zero is "nothing happened yet"
 *   int NAME_open(view)   check its section and set view->NAME: called once by bank_view_open when the bank names the
 *                         effect; STATUS_OK, or STATUS_BANK_* with fault_tag and fault_record set
 *
 * and whatever the stages of hooks.h call. */
#ifndef TROCAR_EFFECTS_H
#define TROCAR_EFFECTS_H

#include "effects/image.h"

#if IF_FRICTION(1) + 0
#include "effects/friction.h"
#endif
#if IF_GRASP(1) + 0
#include "effects/grasp.h"
#endif
#if IF_NEO_HOOKEAN(1) + 0
#include "effects/neo_hookean.h"
#endif
#if IF_QUASI_NONLINEAR(1) + 0
#include "effects/quasi_nonlinear.h"
#endif
#if IF_SECOND(1) + 0
#include "effects/second.h"
#endif
#if IF_SHAPE(1) + 0
#include "effects/shape.h"
#endif
#if IF_RIGID(1) + 0
#include "effects/rigid.h"
#endif
#if IF_SWING(1) + 0
#include "effects/swing.h"
#endif
#if IF_VISCOELASTIC(1) + 0
#include "effects/viscoelastic.h"
#endif

#endif
