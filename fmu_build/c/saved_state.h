/* Copies of an instance's Dynamics, owned by the importer between save and free, and the same as bytes. */
#ifndef SAVED_STATE_H
#define SAVED_STATE_H

#include "instance.h"

/* Saves to *saved, whose memory is taken if it is NULL. */
Status saved_state_save(Instance *instance, void **saved);
Status saved_state_restore(Instance *instance, const void *saved);

/* Frees *saved, which may be NULL, and makes it NULL. */
Status saved_state_free(Instance *instance, void **saved);

Status saved_state_size(Instance *instance, const void *saved, size_t *size);
Status saved_state_serialize(Instance *instance, const void *saved, unsigned char bytes[], size_t size);

/* Refuses bytes that are damaged, or of another model, version or kind of machine. */
Status saved_state_deserialize(Instance *instance, const unsigned char bytes[], size_t size, void **saved);

#endif
