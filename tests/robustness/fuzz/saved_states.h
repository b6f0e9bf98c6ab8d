/* Saving, restoring, freeing, serialising; bytes that are damaged on purpose. */
#ifndef FUZZ_SAVED_STATES_H
#define FUZZ_SAVED_STATES_H

#include "functions.h"

static Answer save_some(Slot *slot) {
    const unsigned k = below(SAVED);
    if (once_in(60)) return (Answer){save(slot, NULL), AN_ERROR};
    slot->known[k] = slot->now;
    return (Answer){save(slot, &slot->saved[k]), FINE};
}

static Answer restore_some(Slot *slot) {
    const unsigned k = below(SAVED);
    if (!slot->saved[k] && !once_in(20)) return NOTHING;
    const bool in_event = slot->saved[k] && slot->known[k].state == EVENT;
    const bool right = slot->saved[k] && (!in_event || slot->exchange || slot->events);
    const Answer answer = {restore(slot, slot->saved[k]), right ? FINE : AN_ERROR};
    if (answer.status == OK) slot->now = slot->known[k];
    return answer;
}

static Answer free_some(Slot *slot) {
    void *nothing = NULL;
    called = EITHER("fmi2FreeFMUstate", "fmi3FreeFMUState");
    if (once_in(8)) {
        void **given = once_in(2) ? NULL : &nothing;
        return (Answer){(int)EITHER(fmi2FreeFMUstate, fmi3FreeFMUState)(slot->component, given), FINE};
    }
    free_state(slot, &slot->saved[below(SAVED)]);
    return (Answer){OK, FINE};
}

static Answer serialize(Slot *slot) {
    const unsigned k = below(SAVED);
    Blob *blob = &blobs[below(BLOBS)];
    size_t size = 0;
    const bool there = slot->saved[k] != NULL, wrong = once_in(20);
    if (!there && !once_in(20)) return NOTHING;
    called = EITHER("fmi2SerializedFMUstateSize", "fmi3SerializedFMUStateSize");
    Answer answer = {OK, there ? FINE : AN_ERROR};
    answer.status = (int)EITHER(fmi2SerializedFMUstateSize, fmi3SerializedFMUStateSize)(slot->component, slot->saved[k],
                                                                                        &size);
    if (answer.status != OK) return answer;
    free(blob->bytes);
    *blob = (Blob){array(size, 1), size, slot->exchange, !wrong, slot->known[k]};
    called = EITHER("fmi2SerializeFMUstate", "fmi3SerializeFMUState");
    answer.expected = wrong ? AN_ERROR : FINE;
    answer.status = (int)EITHER(fmi2SerializeFMUstate, fmi3SerializeFMUState)(
        slot->component, slot->saved[k], (void *)blob->bytes, wrong ? size - 1 - below((unsigned)size - 1) : size);
    if (answer.status == OK) note(blob->bytes, 8);
    return answer;
}

/* Damages bytes in one of several ways. Returns how many are left. */
static size_t damage(unsigned char bytes[], size_t size) {
    switch (below(3)) {
        case 0: bytes[below((unsigned)size)] ^= (unsigned char)(1u << below(8)); return size;
        case 1: return below((unsigned)size);
        default:
            for (size_t i = once_in(2) ? 0 : 24; i < size; i++) bytes[i] = (unsigned char)draw();
            return size;
    }
}

static Answer deserialize(Slot *slot) {
    const Blob *blob = &blobs[below(BLOBS)];
    const unsigned k = below(SAVED);
    const bool whole = blob->whole && !once_in(8);
    if (!blob->bytes || (blob->exchange != slot->exchange && !once_in(8))) return NOTHING;
    unsigned char *bytes = array(blob->size, 1);
    memcpy(bytes, blob->bytes, blob->size);
    const size_t size = whole ? blob->size : damage(bytes, blob->size);
    void *state = NULL;
    called = EITHER("fmi2DeSerializeFMUstate", "fmi3DeserializeFMUState");
    Answer answer = {OK, whole ? FINE : AN_ERROR};
    answer.status = (int)EITHER(fmi2DeSerializeFMUstate, fmi3DeserializeFMUState)(slot->component, (void *)bytes, size,
                                                                                  &state);
    free(bytes);
    if (answer.status != OK) {
        if (state) fail("a refused state was made", slot, answer.status);
        return answer;
    }
    if (blob->exchange == slot->exchange) {
        free_state(slot, &slot->saved[k]);
        slot->saved[k] = state;
        slot->known[k] = blob->known;
        return answer;
    }
    answer = (Answer){restore(slot, state), AN_ERROR};
    const char *name = called;
    free_state(slot, &state);
    called = name;
    return answer;
}

#endif
