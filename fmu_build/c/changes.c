/* A change of inputs can change the rate: what it is after one, and from what the next one begins.

   Owns p, c, kept_rate, kept_c and, between steps, stepped_p of Dynamics. A change goes from the inputs as committed to
   those as they are, at one instant: kept_momentum.c or kept_rate.c, then docks that close, docking.c. */
#include "changes.h"

#include <math.h>
#include <string.h>

#include "docks.h"
#include "error_bound.h"
#include "exchange_state.h"
#include "hand_over.h"
#include "kept_in_changes.h"

static void copy_p(double to[], const double from[]) {
    memcpy(to, from, INPUT_P_COUNT * sizeof(double));
}

/* Refuses a change that leaves such a rate; the first dock that closes is named. */
static Status refuse_rate(Instance *instance, const double p[], const double rate[RATE_COUNT]) {
    const char *closing = docks_first_closing(instance, p);
    const char *name = closing ? closing : "", *words = closing ? " = true with this motion" : "the change";
    return instance_refuse(instance, "%s%s leaves angular_velocity = (%.10g, %.10g, %.10g) rad/s: must be finite", name,
                           words, rate[0], rate[1], rate[2]);
}

/* The angular velocity after a change from what was committed to p, whose composite is c. */
static Status rate_after(Instance *instance, const double p[], const double c[], double rate[RATE_COUNT]) {
    const Dynamics *now = &instance->now;
    memcpy(rate, now->kept_rate, sizeof now->kept_rate);
    hand_over_hold(instance);
    if (memcmp(p, now->stepped_p, INPUT_P_COUNT * sizeof(double)) == 0) return STATUS_OK;
    Status status = rate_on_the_way(instance, p, c, rate);
    if (status == STATUS_OK) status = hand_over_change(instance, p, c, rate);
    if (status != STATUS_OK) return status;
    docks_join(instance, p, c, rate);
    const bool finite = isfinite(rate[0]) && isfinite(rate[1]) && isfinite(rate[2]);
    return finite ? STATUS_OK : refuse_rate(instance, p, rate);
}

static void become_current(Instance *instance, const double p[], const double c[]) {
    Dynamics *now = &instance->now;
    if (p != now->p) copy_p(now->p, p);
    if (c != now->c) memcpy(now->c, c, sizeof now->c);
}

static void begin_from_now(Dynamics *now) {
    if (memcmp(now->stepped_p, now->p, INPUT_P_COUNT * sizeof(double)) != 0) now->epoch_holds = false;
    copy_p(now->stepped_p, now->p);
    memcpy(now->kept_c, now->c, sizeof now->kept_c);
}

void changes_begin(Instance *instance) {
    Dynamics *now = &instance->now;
    if (now->model_exchange || memcmp(now->p, now->stepped_p, INPUT_P_COUNT * sizeof(double)) != 0) return;
    memcpy(now->kept_rate, instance_x(instance) + 4, sizeof now->kept_rate);
    memcpy(now->kept_c, now->c, sizeof now->kept_c);
}

/* In continuous time the state stays as it is. */
static Status apply_continuous(Instance *instance, const double p[], const double c[]) {
    const Status status = exchange_check_continuous(instance, p);
    if (status != STATUS_OK) return status;
    become_current(instance, p, c);
    begin_from_now(&instance->now);
    instance_state_moved(instance);
    return STATUS_OK;
}

Status changes_apply(Instance *instance, const double p[], const double c[]) {
    double rate[RATE_COUNT];
    if (changes_state(instance) & BEFORE_START) {
        become_current(instance, p, c);
        instance_state_moved(instance);
        return STATUS_OK;
    }
    if (changes_state(instance) == CONTINUOUS) return apply_continuous(instance, p, c);
    changes_begin(instance);
    const Status status = rate_after(instance, p, c, rate);
    if (status != STATUS_OK) return status;
    become_current(instance, p, c);
    instance_state_moved(instance);
    exchange_take_rate(instance, rate);
    return STATUS_OK;
}

Status changes_settle(Instance *instance) {
    Dynamics *now = &instance->now;
    double *inputs = &now->values[REFERENCE_P], set[INPUT_P_COUNT];
    if (now->composite_is_current) return STATUS_OK;
    copy_p(set, inputs);
    bool waits = false;
    for (size_t i = 0; i < INPUT_P_COUNT; i++) {
        if (!(INPUT_KINDS[i] & DISCRETE_KINDS) || inputs[i] == now->stepped_p[i]) continue;
        inputs[i] = now->stepped_p[i];
        waits = true;
    }
    const Status status = composite_refresh(instance);
    copy_p(inputs, set);
    if (waits) now->composite_is_current = false;
    return status;
}

void changes_commit(Instance *instance) {
    Dynamics *now = &instance->now;
    changes_mirror(instance);
    if (changes_state(instance) == EVENT) bound_over_change(instance);
    begin_from_now(now);
    bound_remember(instance);
    memcpy(now->kept_rate, instance_x(instance) + 4, sizeof now->kept_rate);
    exchange_commit(instance);
}

void changes_start(Instance *instance) {
    changes_commit(instance);
}
