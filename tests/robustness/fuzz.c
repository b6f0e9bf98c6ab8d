/* Calls the FMI functions of a scene in random order with random arguments, and checks what holds whatever is called:

   - a call that the state or its arguments forbid is an error, one that they allow is none;
   - a call not answered with OK logs one line, of its status and with its name, if that category is on;
   - after a discarded call, and after an error, everything reads bit for bit as before the call;
   - after an error nothing goes on but reading, saved states and a reset;
   - the attitude of a running instance is finite and unit, and its time the one that the importer knows.

   Linked with the sources of the FMU, with -DFMI=2 or -DFMI=3; sanitizers see what those do wrong.

       fuzz SEED CALLS

   prints how the calls were answered, calls per second, and a digest of all answers, the same for each build of the
   same sources. Exit status 1: a rule was broken, and stderr says which and where; 2: a call did not return. */
#define _POSIX_C_SOURCE 200809L

#include <signal.h>
#include <time.h>
#include <unistd.h>

#include "fuzz/absent.h"
#include "fuzz/exchange.h"
#include "fuzz/life_cycle.h"
#include "fuzz/rules.h"
#include "fuzz/saved_states.h"
#include "fuzz/steps.h"
#include "fuzz/values.h"

/* How often each call is made, and in which states mostly: what the state forbids is called seldom, or instances
   would hardly ever run. */
static const struct {
    Answer (*call)(Slot *);
    unsigned weight, states;
} CALLS[] = {
    {enter, 6, INSTANTIATED},
    {leave, 12, INITIALIZATION},
    {terminate, 2, RUNNING},
    {start_again, 4, ALL},
    {set_logging, 1, ALL},
    {get, 6, EITHER(ALL & ~INSTANTIATED, ALL)},
    {set, 6, ALL & ~TERMINATED},
    {set_good_inputs, 3, ALL & ~TERMINATED},
#if DOCK_COUNT
    {get_some_booleans, 2, EITHER(ALL & ~INSTANTIATED, ALL)},
    {set_some_booleans, 4, ALL & ~TERMINATED},
#endif
    {step, 24, STEPPING},
    {derivative, 4, ALL & ~INSTANTIATED},
    {output_derivative, 3, STEPPING},
    {set_time, 3, EXCHANGING | NO_STEPS},
    {set_states, 6, CONTINUOUS},
    {get_states, 6, EXCHANGING | NO_STEPS},
    {get_indicators, 1, EXCHANGING | NO_STEPS},
    {update_discrete_states, 3, EVENT},
    {change_mode, 4, EXCHANGING | (HAS_EVENT_MODE ? STEPPING : 0)},
    {complete_step, 3, CONTINUOUS},
    {save_some, 2, ALL},
    {restore_some, 2, ALL},
    {free_some, 1, ALL},
    {serialize, 1, ALL},
    {deserialize, 1, ALL},
    {other_type, 1, ALL},
    {unsupported, 1, ALL},
    {without_instance, 1, ALL},
    {destroy, 1, ALL},
#if FMI == 2
    {step_status, 2, STEPPING},
#endif
};

static size_t draw_call(void) {
    const size_t count = sizeof CALLS / sizeof CALLS[0];
    unsigned total = 0;
    for (size_t i = 0; i < count; i++) total += CALLS[i].weight;
    unsigned rest = below(total);
    size_t i = 0;
    while (rest >= CALLS[i].weight) rest -= CALLS[i++].weight;
    return i;
}

static void call_one(Slot *slot) {
    const size_t k = draw_call();
    const unsigned states = slot->exchange || !(CALLS[k].states & NO_STEPS) ? CALLS[k].states : 0;
    if (!(slot->now.state & states) && !once_in(100)) return;
    if (save(slot, &slot->before) != OK) fail("a state cannot be saved", slot, ERROR);
    const Known known = slot->now;
    const unsigned log_mask = slot->log_mask;
    slot->lines = 0;
    slot->inner_error = false;
    const Answer answer = CALLS[k].call(slot);
    if (answer.status == NOT_CALLED) return;
    call_count++;
    check(slot, answer, &known, log_mask);
}

static void hung(int number) {
    static const char text[] = "a call did not return\n";
    (void)number;
    _exit(write(2, text, sizeof text - 1) < 0 ? 3 : 2);
}

static double now_in_seconds(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

int main(int count, char *arguments[]) {
    if (count != 3) return 3;
    seed = strtoull(arguments[1], NULL, 10);
    random_state = (seed + 1) * UINT64_C(11400714819323198485);
    const unsigned long long calls = strtoull(arguments[2], NULL, 10);
    while (strncmp(VARIABLES[attitude_reference].name, "attitude[", 9) != 0) attitude_reference++;
    signal(SIGALRM, hung);
    const double start = now_in_seconds();
    for (unsigned long long round = 0; call_count < calls; round++) {
        Slot *slot = &slots[below(SLOTS)];
        if (round % 4096 == 0) alarm(PATIENCE);
        if (slot->component) call_one(slot);
        else make_instance(slot);
    }
    for (size_t i = 0; i < SLOTS; i++) free_slot(&slots[i]);
    for (size_t i = 0; i < BLOBS; i++) free(blobs[i].bytes);
    const double duration = now_in_seconds() - start;
    printf("%llu calls in %.1f s, %.0f a second: %lu ok, %lu discarded, %lu errors; %lu steps taken; digest %016llx\n",
           call_count, duration, (double)call_count / duration, answered[OK], answered[DISCARD], answered[ERROR],
           steps_taken, (unsigned long long)digest);
    return 0;
}
