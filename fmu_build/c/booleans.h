/* Booleans, all of them inputs: whether docks are closed. Their values are 0 and 1. */
#ifndef BOOLEANS_H
#define BOOLEANS_H

#include "variables.h"

/* Whether these references are Booleans, and the array of values is there. */
Status instance_check_booleans(Instance *instance, const unsigned references[], size_t count, const void *values);

/* Whether one may be set to a value now: outside event mode it must keep the one it has. Then get and set cannot
   fail. */
Status instance_check_boolean(Instance *instance, unsigned reference, bool value);
bool instance_get_boolean(const Instance *instance, unsigned reference);
void instance_set_boolean(Instance *instance, unsigned reference, bool value);

#endif
