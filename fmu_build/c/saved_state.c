/* Saved states: copies of Dynamics as they are, and as bytes behind a header that tells whose they are.

   Owns nothing: a saved state is the importer's until it is freed. Needs the token, by which states of other models, or
   of other versions of this one, are refused. */
#include "saved_state.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "variables.h"

/* A serialised state: magic, checksum of what follows it, length of the token, the token, Dynamics. */
static const char MAGIC[8] = {'s', 'u', 'p', 'e', 'r', 'v', 's', '1'};

enum { HEADER_SIZE = 8 + 8 + 8 };

static size_t token_size(void) {
    return strlen(MODEL_TOKEN);
}

static size_t serialized_size(void) {
    return HEADER_SIZE + token_size() + sizeof(Dynamics);
}

/* FNV-1a, 64 bits: tells damaged bytes from whole ones, not forged ones. */
static uint64_t checksum(const unsigned char bytes[], size_t size) {
    uint64_t hash = UINT64_C(14695981039346656037);
    for (size_t i = 0; i < size; i++) hash = (hash ^ bytes[i]) * UINT64_C(1099511628211);
    return hash;
}

Status saved_state_save(Instance *instance, void **saved) {
    if (!saved) return instance_error(instance, "the pointer to the FMU state is NULL");
    if (!*saved) *saved = malloc(sizeof(Dynamics));
    if (!*saved) return instance_error(instance, "out of memory");
    memcpy(*saved, &instance->now, sizeof(Dynamics));
    return STATUS_OK;
}

Status saved_state_restore(Instance *instance, const void *saved) {
    if (!saved) return instance_error(instance, "the FMU state is NULL");
    const Dynamics *dynamics = saved;
    if (dynamics->model_exchange != instance->now.model_exchange)
        return instance_error(instance, "the FMU state is one of %s, this instance is not",
                              dynamics->model_exchange ? "model exchange" : "co-simulation");
    if (dynamics->state == EVENT && !dynamics->model_exchange && !instance->event_mode_used)
        return instance_error(instance, "the FMU state is one in event mode, and eventModeUsed was false when this "
                                        "instance was made");
    memcpy(&instance->now, saved, sizeof(Dynamics));
    instance_state_moved(instance);
    return STATUS_OK;
}

Status saved_state_free(Instance *instance, void **saved) {
    (void)instance;
    if (!saved) return STATUS_OK;
    free(*saved);
    *saved = NULL;
    return STATUS_OK;
}

Status saved_state_size(Instance *instance, const void *saved, size_t *size) {
    if (!saved || !size) return instance_error(instance, "the FMU state or the pointer to its size is NULL");
    *size = serialized_size();
    return STATUS_OK;
}

Status saved_state_serialize(Instance *instance, const void *saved, unsigned char bytes[], size_t size) {
    if (!saved || !bytes) return instance_error(instance, "the FMU state or the array of bytes is NULL");
    if (size != serialized_size())
        return instance_error(instance, "size = %zu: must be %zu", size, serialized_size());
    const uint64_t token = token_size();
    memcpy(bytes, MAGIC, 8);
    memcpy(bytes + 16, &token, 8);
    memcpy(bytes + HEADER_SIZE, MODEL_TOKEN, token_size());
    memcpy(bytes + HEADER_SIZE + token_size(), saved, sizeof(Dynamics));
    const uint64_t sum = checksum(bytes + 16, size - 16);
    memcpy(bytes + 8, &sum, 8);
    return STATUS_OK;
}

/* What keeps bytes from being a state of this model, or NULL. */
static const char *bytes_problem(const unsigned char bytes[], size_t size) {
    if (size < HEADER_SIZE || memcmp(bytes, MAGIC, 8) != 0) return "the bytes are not a state of such an FMU";
    uint64_t sum, token;
    memcpy(&sum, bytes + 8, 8);
    memcpy(&token, bytes + 16, 8);
    if (sum != checksum(bytes + 16, size - 16)) return "the bytes are damaged or cut off";
    if (token != token_size() || size < HEADER_SIZE + token_size() ||
        memcmp(bytes + HEADER_SIZE, MODEL_TOKEN, token_size()) != 0)
        return "the bytes are a state of another model, or of another version of this one";
    if (size != serialized_size()) return "the bytes are a state of this model on a different kind of machine";
    return NULL;
}

Status saved_state_deserialize(Instance *instance, const unsigned char bytes[], size_t size, void **saved) {
    if (!bytes || !saved) return instance_error(instance, "the array of bytes or the pointer to the state is NULL");
    const char *problem = bytes_problem(bytes, size);
    if (problem) return instance_error(instance, "%s", problem);
    if (!*saved) *saved = malloc(sizeof(Dynamics));
    if (!*saved) return instance_error(instance, "out of memory");
    memcpy(*saved, bytes + HEADER_SIZE + token_size(), sizeof(Dynamics));
    return STATUS_OK;
}
