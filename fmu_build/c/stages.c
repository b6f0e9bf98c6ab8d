/* The stages of a change of inputs. Needs of the model: INPUT_KINDS, which inputs are which. */
#include "stages.h"

#include <string.h>

bool move_stage(Stage *stage, const double p[], unsigned kinds) {
    enum { AT_ONCE = 64 };
    bool changed = false;
    for (size_t begin = 0; begin < INPUT_P_COUNT; begin += AT_ONCE) {
        const size_t end = begin + AT_ONCE < INPUT_P_COUNT ? begin + AT_ONCE : INPUT_P_COUNT;
        if (memcmp(&stage->p[begin], &p[begin], (end - begin) * sizeof *p) == 0) continue;
        for (size_t i = begin; i < end; i++) {
            if (!(INPUT_KINDS[i] & kinds) || stage->p[i] == p[i]) continue;
            if (INPUT_KINDS[i] == KIND_DOCKED && p[i] != 0.0) continue;
            stage->p[i] = p[i];
            changed = true;
        }
    }
    if (changed) stage->c_is_current = false;
    return changed;
}

void first_stage(Stage *stage, const double from[], const double c[], const double p[]) {
    memcpy(stage->p, from, sizeof stage->p);
    memcpy(stage->c, c, sizeof stage->c);
    stage->c_is_current = true;
    move_stage(stage, p, KIND_DOCKED);
}
