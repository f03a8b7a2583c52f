/* The contents of a bank's sections: every index inside its table, every float finite and plausible. Called by
 * bank_view_open once the table, the lengths and the checksums are known to be right; nothing else needs it. */
#ifndef TROCAR_BANK_CHECK_H
#define TROCAR_BANK_CHECK_H

#include "bank_view.h"

/* `view` has its counts and pointers set. STATUS_OK, STATUS_BANK_INDEX or STATUS_BANK_NONFINITE, with the fault's
 * place. */
int bank_check_contents(struct bank_view *view);

#endif
