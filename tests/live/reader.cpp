// Independent reader in C++ with eProsima Fast DDS: prints each frame of a skin as a line of JSON.
//
//     reader DOMAIN LINK
//
// It uses the loopback device alone.
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <memory>
#include <mutex>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>

#include "SkinPubSubTypes.h"

using namespace eprosima::fastdds::dds;
using namespace eprosima::fastdds::rtps;
using namespace skin_calib_msgs::msg::dds_;

namespace {

void text(const char* name, const std::string& value) { std::printf(", \"%s\": \"%s\"", name, value.c_str()); }
void truth(const char* name, bool value) { std::printf(", \"%s\": %s", name, value ? "true" : "false"); }
void number(double x) { std::isnan(x) ? std::printf("NaN") : std::printf("%.17g", x); }

void real(const char* name, double x) {
    std::printf(", \"%s\": ", name);
    number(x);
}

template <class Numbers> void reals(const char* name, const Numbers& numbers) {
    std::printf(", \"%s\": [", name);
    bool is_first = true;
    for (double x : numbers) std::printf("%s", is_first ? "" : ", "), number(x), is_first = false;
    std::printf("]");
}

template <class Vector> std::vector<double> vector(const Vector& v) { return {v.x(), v.y(), v.z()}; }

void wrench(const char* name, const geometry_msgs::msg::dds_::Wrench_& w) {
    std::vector<double> numbers = vector(w.force());
    for (double x : vector(w.torque())) numbers.push_back(x);
    reals(name, numbers);
}

void polygon(const char* name, const SkinPolygon_& p) {
    std::printf(", \"%s\": {\"is\": 1", name);
    reals("x", p.x()), reals("y", p.y()), real("probability", p.probability());
    std::printf("}");
}

void print(const SkinFrame_& f) {
    const auto& stamp = f.header().stamp();
    std::printf("{\"message\": \"SkinFrame\", \"sec\": %d, \"nanosec\": %u", stamp.sec(), stamp.nanosec());
    text("frame_id", f.header().frame_id());
    std::printf(", \"cycle\": %llu, \"lost\": %llu", (unsigned long long)f.cycle(), (unsigned long long)f.lost());
    text("calibration", f.calibration());
    truth("trusted", f.trusted()), truth("trusted_touched", f.trusted_touched());
    truth("trusted_wrench", f.trusted_wrench()), truth("trusted_point", f.trusted_point());
    truth("trusted_guaranteed", f.trusted_guaranteed());
    std::printf(", \"flags\": [");
    for (std::size_t i = 0; i < f.flags().size(); ++i) std::printf("%s\"%s\"", i ? ", " : "", f.flags()[i].c_str());
    std::printf("]");
    text("problem", f.problem());
    truth("touched", f.touched()), truth("touched_known", f.touched_known());
    std::printf(", \"contacts\": [");
    for (std::size_t i = 0; i < f.contacts().size(); ++i) {
        const SkinContact_& c = f.contacts()[i];
        std::printf("%s{\"number\": %lld", i ? ", " : "", (long long)c.number());
        reals("taxels", c.taxels());
        real("force", c.force()), real("area", c.area()), real("peak_pressure", c.peak_pressure());
        reals("position", vector(c.position())), reals("normal", vector(c.normal())), wrench("wrench", c.wrench());
        std::printf("}");
    }
    std::printf("]");
    wrench("wrench", f.wrench()), wrench("wrench_sigma", f.wrench_sigma());
    truth("stands", f.stands()), text("reason", f.reason());
    real("load", f.load()), real("load_sigma", f.load_sigma());
    reals("cop", f.cop()), reals("cop_sigma", f.cop_sigma()), reals("zmp", f.zmp()), reals("zmp_sigma", f.zmp_sigma());
    polygon("outer", f.outer()), polygon("nominal", f.nominal()), polygon("guaranteed", f.guaranteed());
    reals("forces", f.forces());
    std::printf(", \"quantities\": [");
    for (std::size_t i = 0; i < f.quantities().size(); ++i) {
        std::printf("%s{\"is\": 1", i ? ", " : "");
        text("name", f.quantities()[i].name()), text("unit", f.quantities()[i].unit());
        reals("values", f.quantities()[i].values());
        std::printf("}");
    }
    std::printf("]}\n");
    std::fflush(stdout);
}

void say(const char* message) {
    std::printf("{\"message\": \"%s\"}\n", message);
    std::fflush(stdout);
}

struct Listener : DataReaderListener {
    void on_subscription_matched(DataReader*, const SubscriptionMatchedStatus& status) override {
        if (status.current_count_change > 0) say("matched");
    }
    void on_data_available(DataReader* reader) override {
        SkinFrame_ frame;
        SampleInfo info;
        while (reader->take_next_sample(&frame, &info) == ReturnCode_t::RETCODE_OK)
            if (info.valid_data) print(frame);
    }
};

} // namespace

int main(int count, char** words) {
    if (count < 3) return 2;
    const int domain = std::atoi(words[1]);
    DomainParticipantQos qos;
    auto transport = std::make_shared<UDPv4TransportDescriptor>();
    transport->interfaceWhiteList.push_back("127.0.0.1");
    qos.transport().use_builtin_transports = false;
    qos.transport().user_transports.push_back(transport);
    eprosima::fastrtps::rtps::Locator_t here;
    eprosima::fastrtps::rtps::IPLocator::setIPv4(here, "127.0.0.1");
    qos.wire_protocol().builtin.initialPeersList.push_back(here);
    DomainParticipant* participant = DomainParticipantFactory::get_instance()->create_participant(domain, qos);
    if (!participant) return 1;
    TypeSupport type(new SkinFrame_PubSubType());
    type.register_type(participant);
    Topic* topic = participant->create_topic(std::string("rt/skin/") + words[2] + "/frame", type.get_type_name(),
                                             TOPIC_QOS_DEFAULT);
    Listener listener;
    DataReaderQos reader;
    reader.reliability().kind = RELIABLE_RELIABILITY_QOS;
    reader.history().kind = KEEP_LAST_HISTORY_QOS;
    reader.history().depth = 1000;
    reader.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
    if (!topic || !participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT)->create_datareader(topic, reader, &listener))
        return 1;
    say("ready");
    std::mutex mutex;
    std::unique_lock<std::mutex> lock(mutex);
    std::condition_variable().wait(lock, [] { return false; });
}
