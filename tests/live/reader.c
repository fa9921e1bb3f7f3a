// Independent reader in C with Eclipse Cyclone DDS: prints each message of a skin as a line of JSON.
//
//     reader DOMAIN LINK full|short [DELAY_MS] [DEPTH]
//
// "short" prints the numbers of a frame that a benchmark needs. A delay after each message makes the reader slow.
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "dds/dds.h"
#include "skin_calib_msgs/msg/SkinFrame.h"
#include "skin_calib_msgs/msg/TaxelLayout.h"

typedef skin_calib_msgs_msg_dds__SkinFrame_ Frame;
typedef skin_calib_msgs_msg_dds__TaxelLayout_ Layout;

static void text(const char* name, const char* value) { printf(", \"%s\": \"%s\"", name, value); }
static void truth(const char* name, bool value) { printf(", \"%s\": %s", name, value ? "true" : "false"); }
static void number(double x) { isnan(x) ? printf("NaN") : printf("%.17g", x); }

static void real(const char* name, double x) {
    printf(", \"%s\": ", name);
    number(x);
}

static void reals(const char* name, const double* x, size_t n) {
    printf(", \"%s\": [", name);
    for (size_t i = 0; i < n; ++i) printf(i ? ", " : ""), number(x[i]);
    printf("]");
}

static void integers(const char* name, const int32_t* x, size_t n) {
    printf(", \"%s\": [", name);
    for (size_t i = 0; i < n; ++i) printf("%s%" PRId32, i ? ", " : "", x[i]);
    printf("]");
}

static void texts(const char* name, char** x, size_t n) {
    printf(", \"%s\": [", name);
    for (size_t i = 0; i < n; ++i) printf("%s\"%s\"", i ? ", " : "", x[i]);
    printf("]");
}

// Messages of three or six doubles: their bytes are those of an array.
#define VECTOR(name, v) reals(name, (const double*)&(v), sizeof(v) / sizeof(double))
#define VECTORS(name, s) reals(name, (const double*)(s)._buffer, (s)._length * 3)
#define SEQUENCE(print, name, s) print(name, (s)._buffer, (s)._length)

static void polygon(const char* name, const skin_calib_msgs_msg_dds__SkinPolygon_* p) {
    printf(", \"%s\": {\"is\": 1", name);
    SEQUENCE(reals, "x", p->x);
    SEQUENCE(reals, "y", p->y);
    real("probability", p->probability);
    printf("}");
}

static void header(const char* kind, const std_msgs_msg_dds__Header_* h) {
    printf("{\"message\": \"%s\", \"sec\": %" PRId32 ", \"nanosec\": %" PRIu32, kind, h->stamp.sec, h->stamp.nanosec);
    text("frame_id", h->frame_id);
}

static void print_frame(const Frame* f) {
    header("SkinFrame", &f->header);
    printf(", \"cycle\": %" PRIu64 ", \"lost\": %" PRIu64, f->cycle, f->lost);
    text("calibration", f->calibration);
    truth("trusted", f->trusted), truth("trusted_touched", f->trusted_touched);
    truth("trusted_wrench", f->trusted_wrench), truth("trusted_point", f->trusted_point);
    truth("trusted_guaranteed", f->trusted_guaranteed);
    SEQUENCE(texts, "flags", f->flags);
    text("problem", f->problem);
    truth("touched", f->touched), truth("touched_known", f->touched_known);
    printf(", \"contacts\": [");
    for (size_t i = 0; i < f->contacts._length; ++i) {
        const skin_calib_msgs_msg_dds__SkinContact_* c = &f->contacts._buffer[i];
        printf("%s{\"number\": %" PRId64, i ? ", " : "", c->number);
        SEQUENCE(integers, "taxels", c->taxels);
        real("force", c->force), real("area", c->area), real("peak_pressure", c->peak_pressure);
        VECTOR("position", c->position), VECTOR("normal", c->normal), VECTOR("wrench", c->wrench);
        printf("}");
    }
    printf("]");
    VECTOR("wrench", f->wrench), VECTOR("wrench_sigma", f->wrench_sigma);
    truth("stands", f->stands);
    text("reason", f->reason);
    real("load", f->load), real("load_sigma", f->load_sigma);
    VECTOR("cop", f->cop), VECTOR("cop_sigma", f->cop_sigma), VECTOR("zmp", f->zmp), VECTOR("zmp_sigma", f->zmp_sigma);
    polygon("outer", &f->outer), polygon("nominal", &f->nominal), polygon("guaranteed", &f->guaranteed);
    SEQUENCE(reals, "forces", f->forces);
    printf(", \"quantities\": [");
    for (size_t i = 0; i < f->quantities._length; ++i) {
        printf("%s{\"is\": 1", i ? ", " : "");
        text("name", f->quantities._buffer[i].name), text("unit", f->quantities._buffer[i].unit);
        SEQUENCE(reals, "values", f->quantities._buffer[i].values);
        printf("}");
    }
    printf("]}\n");
}

static void print_layout(const Layout* m) {
    header("TaxelLayout", &m->header);
    printf(", \"version\": %" PRId32, m->version);
    text("calibration", m->calibration), truth("is_virtual", m->is_virtual);
    SEQUENCE(texts, "ids", m->ids);
    SEQUENCE(integers, "channels", m->channels);
    VECTORS("positions", m->positions), VECTORS("normals", m->normals), VECTORS("tangents", m->tangents);
    SEQUENCE(reals, "areas", m->areas);
    SEQUENCE(reals, "sigma_along", m->sigma_along);
    SEQUENCE(reals, "sigma_normal", m->sigma_normal);
    SEQUENCE(reals, "sigma_angle", m->sigma_angle);
    SEQUENCE(reals, "thresholds", m->thresholds);
    truth("has_ground", m->has_ground);
    VECTOR("ground_origin", m->ground_origin), VECTOR("ground_x", m->ground_x), VECTOR("ground_z", m->ground_z);
    printf("}\n");
}

static dds_entity_t subscribe(dds_entity_t participant, const dds_topic_descriptor_t* type, const char* link,
                              const char* name, bool is_latched, int depth) {
    char topic[256];
    snprintf(topic, sizeof topic, "rt/skin/%s/%s", link, name);
    dds_qos_t* qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
    dds_qset_durability(qos, is_latched ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, depth);
    const dds_entity_t reader =
        dds_create_reader(participant, dds_create_topic(participant, type, topic, NULL, NULL), qos, NULL);
    dds_set_status_mask(reader, DDS_SUBSCRIPTION_MATCHED_STATUS | DDS_DATA_AVAILABLE_STATUS);
    dds_delete_qos(qos);
    return reader;
}

int main(int count, char** words) {
    if (count < 4) return 2;
    const bool is_full = strcmp(words[3], "full") == 0;
    const int delay = count > 4 ? atoi(words[4]) : 0, depth = count > 5 ? atoi(words[5]) : 1000;
    const dds_entity_t participant = dds_create_participant((dds_domainid_t)atoi(words[1]), NULL, NULL);
    const dds_entity_t layouts =
        subscribe(participant, &skin_calib_msgs_msg_dds__TaxelLayout__desc, words[2], "layout", true, 1);
    const dds_entity_t frames =
        subscribe(participant, &skin_calib_msgs_msg_dds__SkinFrame__desc, words[2], "frame", false, depth);
    if (participant < 0 || layouts < 0 || frames < 0) return 1;
    const dds_entity_t set = dds_create_waitset(participant);
    dds_waitset_attach(set, layouts, 0);
    dds_waitset_attach(set, frames, 1);
    printf("{\"message\": \"ready\"}\n");
    for (bool was_matched = false;;) {
        fflush(stdout);
        dds_waitset_wait(set, NULL, 0, DDS_INFINITY);
        uint32_t status = 0;
        dds_subscription_matched_status_t matched;
        dds_take_status(layouts, &status, DDS_SUBSCRIPTION_MATCHED_STATUS);
        dds_get_subscription_matched_status(frames, &matched);
        if (!was_matched && matched.current_count > 0) was_matched = (printf("{\"message\": \"matched\"}\n"), true);
        void* sample = NULL;
        dds_sample_info_t info;
        while (dds_take(layouts, &sample, &info, 1, 1) > 0) {
            if (info.valid_data && is_full) print_layout(sample);
            dds_return_loan(layouts, &sample, 1);
            sample = NULL;
        }
        while (dds_take(frames, &sample, &info, 1, 1) > 0) {
            const Frame* f = sample;
            struct timespec now;
            clock_gettime(CLOCK_REALTIME, &now);
            if (info.valid_data && is_full) print_frame(f);
            const int64_t sent = f->header.stamp.sec * INT64_C(1000000000) + f->header.stamp.nanosec;
            const int64_t late = now.tv_sec * INT64_C(1000000000) + now.tv_nsec - sent;
            if (info.valid_data && !is_full) printf("%" PRIu64 " %" PRId64 " %" PRId64 "\n", f->cycle, sent, late);
            dds_return_loan(frames, &sample, 1);
            sample = NULL;
            if (delay) dds_sleepfor(DDS_MSECS(delay));
        }
    }
}
