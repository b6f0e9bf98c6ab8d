/* One communication step of the FMU, from x under u and p over h, as a function that CasADi loads: included after the
   FMU's own C, whose instance lies in the caller's work array, so that threads share nothing. A refusal is written to
   stderr and returned as 1. */
#include <stdio.h>
#include <string.h>

#include "booleans.h"
#include "instance.h"
#include "solver.h"
#include "variables.h"

#if defined(_WIN32)
#define EXPORTED __declspec(dllexport)
#else
#define EXPORTED __attribute__((visibility("default")))
#endif

/* CasADi's integer. */
typedef long long Whole;

enum { ARGUMENT_COUNT = 4, INPUT_COUNT = INPUT_P_COUNT + INPUT_K_COUNT };

static const Call CALL = {"communication_step", ANY_STATE, STATUS_DISCARD};

EXPORTED Whole communication_step_n_in(void) {
    return ARGUMENT_COUNT;
}

EXPORTED Whole communication_step_n_out(void) {
    return 1;
}

EXPORTED const char *communication_step_name_in(Whole i) {
    static const char *const names[ARGUMENT_COUNT] = {"x", "u", "p", "h"};
    return names[i];
}

EXPORTED const char *communication_step_name_out(Whole i) {
    (void)i;
    return "x_next";
}

/* Rows, columns, and that all elements are there. */
EXPORTED const Whole *communication_step_sparsity_in(Whole i) {
    static const Whole sizes[ARGUMENT_COUNT][3] = {
        {STATE_COUNT, 1, 1}, {INPUT_U_COUNT, 1, 1}, {INPUT_COUNT, 1, 1}, {1, 1, 1}};
    return sizes[i];
}

EXPORTED const Whole *communication_step_sparsity_out(Whole i) {
    return communication_step_sparsity_in(i);
}

/* The instance's name is empty: one byte behind it. */
EXPORTED int communication_step_work(Whole *arg, Whole *res, Whole *integers, Whole *reals) {
    *arg = ARGUMENT_COUNT;
    *res = 1;
    *integers = 0;
    *reals = (Whole)(sizeof(Instance) / sizeof(double) + 1);
    return 0;
}

static void write_to_stderr(const Instance *instance, Status status, const char *category, const char *message) {
    (void)instance, (void)status, (void)category;
    fprintf(stderr, "%s\n", message);
}

/* Sets variables that stand one after the other; values NULL: zeros. */
static Status set_in_order(Instance *instance, unsigned first, unsigned count, const double values[]) {
    Status status = STATUS_OK;
    for (unsigned i = 0; i < count && status == STATUS_OK; i++) {
        const unsigned reference = first + i;
        const double value = values ? values[i] : 0.0;
#if DOCK_COUNT
        if (VARIABLES[reference].type == TYPE_BOOLEAN) {
            if (value != 0.0 && value != 1.0)
                return instance_refuse(instance, "%s = %.10g: must be 0 or 1", VARIABLES[reference].name, value);
            instance_set_boolean(instance, reference, value != 0.0);
            continue;
        }
#endif
        status = instance_set(instance, &reference, 1, &value);
    }
    return status;
}

static Status make_step(Instance *instance, const double *const arg[]) {
    const double *x = arg[0];
    bool ended_early;
    Status status = set_in_order(instance, REFERENCE_ATTITUDE_START, 4, x);
    if (status == STATUS_OK) status = set_in_order(instance, REFERENCE_RATE_START, 3, x ? x + 4 : NULL);
    if (status == STATUS_OK)
        status = set_in_order(instance, REFERENCE_ATTITUDE_START + 4, STATE_COUNT - 7, x ? x + 7 : NULL);
    if (status == STATUS_OK) status = set_in_order(instance, REFERENCE_P, INPUT_COUNT, arg[2]);
    if (status == STATUS_OK) status = set_in_order(instance, REFERENCE_TORQUE, INPUT_U_COUNT, arg[1]);
    if (status == STATUS_OK) status = instance_exit_initialization(instance);
    if (status == STATUS_OK) status = solver_step(instance, 0.0, arg[3] ? *arg[3] : 0.0, &ended_early);
    return status;
}

EXPORTED int communication_step(const double **arg, double **res, Whole *integers, double *reals, int memory) {
    (void)integers, (void)memory;
    Instance *instance = (Instance *)(void *)reals;
    memset(instance, 0, sizeof *instance + 1);
    instance->call = &CALL;
    instance->write_log = write_to_stderr;
    instance->log_categories = LOG_DISCARD | LOG_ERROR;
    instance_reset(instance);
    if (make_step(instance, arg) != STATUS_OK) return 1;
    if (res[0]) memcpy(res[0], instance_x(instance), STATE_COUNT * sizeof(double));
    return 0;
}
