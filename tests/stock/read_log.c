// Reads an LCM event log with stock liblcm and the decoders of stock lcm-gen, for tests/stock.rs to compare with ours.
//
//     read_log LOG
//
// One line a type with its fingerprint; then one line an event: number, time (us), channel, whether the generated encoder gives the
// same bytes again ("same" or "other"), and some fields of the message. A double is printed as its 64 bits.

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include <lcm/lcm.h>

#include "types.h" // written by tests/stock.rs: the headers of all types, and TYPES(X), an X for each

static void integer(int64_t v) { printf(" %" PRId64, v); }

static void real(double v) {
    uint64_t bits;
    memcpy(&bits, &v, sizeof bits);
    printf(" %016" PRIx64, bits);
}

static void base_tracking(const hoofprint_base_tracking_t *m) {
    integer(m->tick), real(m->rpy_est[2]), real(m->height_est), real(m->v_H_des[1]);
}

static void contact_estimate(const hoofprint_contact_estimate_t *m) {
    integer(m->tick), real(m->f_F_W[2][1]), integer(m->contact[3]), real(m->n_W[2]);
}

static void controller_input(const hoofprint_controller_input_t *m) {
    const hoofprint_delivered_t *first = &m->messages[0];
    integer(m->tick), printf(" %s", first->channel), integer(first->size), integer(first->t_arrival_ns);
}

static void controller_tick(const hoofprint_controller_tick_t *m) {
    integer(m->tick), integer(m->mode), real(m->fault_value), integer(m->digest[5]);
}

static void event(const hoofprint_event_t *m) {
    integer(m->level), printf(" %s %s", m->source, m->text);
}

static void ground_truth(const hoofprint_ground_truth_t *m) {
    integer(m->n_contacts), real(m->p_WF[3][2]), real(m->f_F_W[1][0]), integer(m->contact[2]), real(m->tau_push_W[2]);
}

static void leg_state(const hoofprint_leg_state_t *m) {
    integer(m->gait), integer(m->state[1]), real(m->p_BF_H_des[3][2]), real(m->v_BF_H_des[3][2]);
}

static void operator_command(const hoofprint_operator_command_t *m) {
    integer(m->seq), integer(m->mode), real(m->v_H[0]), real(m->height_offset);
}

static void parameter_change(const hoofprint_parameter_change_t *m) {
    integer(m->tick), integer(m->seq), printf(" %s %s", m->key, m->value);
}

static void parameter_request(const hoofprint_parameter_request_t *m) {
    integer(m->seq), printf(" %s %s", m->key, m->value);
}

static void request_reply(const hoofprint_request_reply_t *m) {
    integer(m->tick), integer(m->request_id), integer(m->code), printf(" %s", m->reason);
}

static void component_state(const hoofprint_component_state_t *m) {
    integer(m->tick), real(m->input.state.q[5]), real(m->input.op.v_H[0]), integer(m->controller.size);
}

static void robot_command(const hoofprint_robot_command_t *m) {
    integer(m->mode), real(m->tau[7]), real(m->kd[m->nj - 1]);
}

static void robot_state(const hoofprint_robot_state_t *m) {
    integer(m->seq);
    for (int j = 0; j < m->nj; j++) real(m->q[j]);
    real(m->tau[m->nj - 1]), real(m->a_I[0][2]);
}

static void robot_info(const hoofprint_robot_info_t *m) {
    integer(m->sender_id), printf(" %s", m->robot);
    printf(" %s %s", m->joint_names[m->num_joints - 1], m->urdf_sha256);
}

static void run_info(const hoofprint_run_info_t *m) {
    integer((int64_t)strlen(m->urdf)), integer(m->seed), integer(m->num_lcm_types);
    printf(" %s", m->lcm_types[m->num_lcm_types - 1].name);
}

static void timing(const hoofprint_timing_t *m) {
    integer(m->wall_ns), integer(m->stage_ns[5]);
}

static void wbc_solution(const hoofprint_wbc_solution_t *m) {
    integer(m->n_active), real(m->base_residual), real(m->vd[m->nv - 1]), real(m->f_F_W[1][2]);
}

static uint8_t again[1 << 20];

static const char *compare(int size, const lcm_eventlog_event_t *e) {
    return size == e->datalen && memcmp(again, e->data, (size_t)size) == 0 ? "same" : "other";
}

// Decodes an event of `name`, encodes it again, and prints what the function `type` prints of it.
#define CHANNEL(name, type)                                                                                       \
    if (strcmp(e->channel, name) == 0) {                                                                          \
        hoofprint_##type##_t message;                                                                             \
        int found = hoofprint_##type##_t_decode(e->data, 0, e->datalen, &message);                                \
        if (found != e->datalen) {                                                                                \
            fprintf(stderr, "event %" PRId64 ", %s: %d of %d bytes decoded\n", e->eventnum, name, found, e->datalen); \
            return 0;                                                                                             \
        }                                                                                                         \
        int size = hoofprint_##type##_t_encode(again, 0, sizeof again, &message);                                 \
        printf("%" PRId64 " %" PRId64 " %s %s", e->eventnum, e->timestamp, name, compare(size, e));               \
        type(&message);                                                                                           \
        printf("\n");                                                                                             \
        hoofprint_##type##_t_decode_cleanup(&message);                                                            \
        return 1;                                                                                                 \
    }

static int print(const lcm_eventlog_event_t *e) {
    CHANNEL("RUN_INFO", run_info)
    CHANNEL("ROBOT_INFO", robot_info)
    CHANNEL("EXPECTED_ROBOT", robot_info)
    CHANNEL("ROBOT_STATE", robot_state)
    CHANNEL("OPERATOR_COMMAND", operator_command)
    CHANNEL("CONTROLLER_INPUT", controller_input)
    CHANNEL("CONTROLLER_TICK", controller_tick)
    CHANNEL("CONTACT_ESTIMATE", contact_estimate)
    CHANNEL("BASE_TRACKING", base_tracking)
    CHANNEL("LEG_STATE", leg_state)
    CHANNEL("WBC_SOLUTION", wbc_solution)
    CHANNEL("ROBOT_COMMAND", robot_command)
    CHANNEL("CONTROLLER_SNAPSHOT", component_state)
    CHANNEL("GROUND_TRUTH", ground_truth)
    CHANNEL("PARAMETER_REQUEST", parameter_request)
    CHANNEL("REQUEST_REPLY", request_reply)
    CHANNEL("PARAMETER_CHANGE", parameter_change)
    CHANNEL("TIMING", timing)
    CHANNEL("EVENT", event)
    fprintf(stderr, "event %" PRId64 ": unknown channel %s\n", e->eventnum, e->channel);
    return 0;
}

#define FINGERPRINT(type) printf("hoofprint." #type "_t %016" PRIx64 "\n", (uint64_t)__hoofprint_##type##_t_get_hash());

int main(int argc, char **argv) {
    if (argc != 2) {
        fprintf(stderr, "usage: read_log LOG\n");
        return 2;
    }
    TYPES(FINGERPRINT)
    printf("events\n");

    lcm_eventlog_t *log = lcm_eventlog_create(argv[1], "r");
    if (log == NULL) {
        perror(argv[1]);
        return 1;
    }
    for (lcm_eventlog_event_t *e; (e = lcm_eventlog_read_next_event(log)) != NULL; lcm_eventlog_free_event(e)) {
        if (!print(e)) return 1;
    }
    lcm_eventlog_destroy(log);
    return 0;
}
