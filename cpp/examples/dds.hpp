// Publish the bytes of ROS 2 (CDR) over DDS, as skin_calib_addon/live/dds.py does: the same topics, types and quality
// of service. Needs Cyclone DDS 0.10 (Debian: cyclonedds-dev), whose C library takes a type that is only bytes.
#pragma once

#include <cctype>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsi/ddsi_sertype.h>

namespace dds {

// A message. Cyclone DDS can read up to the next multiple of four bytes.
struct Sample : ddsi_serdata {
    Sample(const ddsi_sertype* of, const std::vector<std::uint8_t>& data) : bytes(data), size(data.size()) {
        ddsi_serdata_init(this, of, SDK_DATA);
        bytes.resize((size + 3) / 4 * 4);
    }

    std::vector<std::uint8_t> bytes;
    std::size_t size;
};

inline const Sample* sample(const ddsi_serdata* data) { return static_cast<const Sample*>(data); }

// What a writer needs of a sample without a key; the rest is of readers.
inline const ddsi_serdata_ops sample_operations = [] {
    ddsi_serdata_ops made{};
    made.eqkey = [](auto*, auto*) { return true; };
    made.get_size = [](auto* data) { return static_cast<std::uint32_t>(sample(data)->size); };
    made.to_ser = [](auto* data, std::size_t begin, std::size_t size, void* out) {
        std::memcpy(out, sample(data)->bytes.data() + begin, size);
    };
    made.to_ser_ref = [](auto* data, std::size_t begin, std::size_t size, ddsrt_iovec_t* out) {
        *out = {const_cast<std::uint8_t*>(sample(data)->bytes.data()) + begin, size};
        return ddsi_serdata_ref(data);
    };
    made.to_ser_unref = [](auto* data, auto*) { ddsi_serdata_unref(data); };
    made.to_untyped = [](auto* data) { return ddsi_serdata_ref(data); };
    made.free = [](auto* data) { delete sample(data); };
    made.print = [](auto*, auto*, char* out, std::size_t) { return std::size_t(*out = 0); };
    made.get_keyhash = [](auto*, auto* out, bool) { *out = {}; };
    return made;
}();

inline const ddsi_sertype_ops type_operations = [] {
    ddsi_sertype_ops made{};
    made.version = ddsi_sertype_v0;
    made.free = [](auto* type) { ddsi_sertype_fini(type), delete type; };
    made.equal = [](auto*, auto*) { return true; }; // for types of the same name
    made.hash = [](auto*) { return std::uint32_t{0}; };
    return made;
}();

// Where a skin publishes: layout (latched) and frames in the domain ROS_DOMAIN_ID. On this computer only, unless
// CYCLONEDDS_URI is set.
class Output {
    struct Writer {
        dds_entity_t entity = 0;
        const ddsi_sertype* type = nullptr;

        bool send(const std::vector<std::uint8_t>& bytes) {
            return dds_writecdr(entity, new Sample(type, bytes)) == DDS_RETCODE_OK;
        }
    };

public:
    Writer layout, frame;

    // Join the domain; return what is wrong, or an empty text.
    std::string open(const std::string& link) {
        const char* text = std::getenv("ROS_DOMAIN_ID");
        const std::string number = text && *text ? text : "0";
        if (number.size() > 3 || number.find_first_not_of("0123456789") != std::string::npos || std::stoi(number) > 232)
            return "ROS_DOMAIN_ID is '" + number + "'. Set a number from 0 to 232";
        const auto domain = static_cast<dds_domainid_t>(std::stoi(number));
        if (!std::getenv("CYCLONEDDS_URI")) domain_ = dds_create_domain(domain, loopback);
        participant_ = dds_create_participant(domain, nullptr, nullptr);
        layout = writer(link, "layout", "TaxelLayout", 1, DDS_DURABILITY_TRANSIENT_LOCAL);
        frame = writer(link, "frame", "SkinFrame", 10, DDS_DURABILITY_VOLATILE);
        for (const dds_entity_t made : {domain_, participant_, layout.entity, frame.entity})
            if (made < 0) return "cannot use DDS domain " + number + ": " + dds_strretcode(made);
        return "";
    }

    // Give readers a second for the last frames, and leave the domain.
    ~Output() {
        if (frame.entity > 0) dds_wait_for_acks(frame.entity, DDS_SECS(1));
        dds_delete(domain_ > 0 ? domain_ : participant_);
    }

private:
    // See skin_calib_addon/live/dds.py for the reasons.
    static constexpr const char* loopback =
        "<CycloneDDS><Domain><General><Interfaces><NetworkInterface address=\"127.0.0.1\"/></Interfaces>"
        "<AllowMulticast>false</AllowMulticast><MaxMessageSize>65500B</MaxMessageSize>"
        "<FragmentSize>65000B</FragmentSize></General><Internal><HeartbeatInterval min=\"2ms\" minsched=\"2ms\" "
        "max=\"1s\">5ms</HeartbeatInterval></Internal><Discovery><ParticipantIndex>auto</ParticipantIndex>"
        "<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><Peers><Peer Address=\"127.0.0.1\"/></Peers></Discovery>"
        "</Domain></CycloneDDS>";

    Writer writer(const std::string& link, const char* topic, const std::string& message, int depth,
                  dds_durability_kind_t durability) const {
        std::string name = "rt/skin/";
        if (link[0] >= '0' && link[0] <= '9') name += '_';
        for (const char c : link)
            if ((c & 0xC0) != 0x80) name += std::isalnum(static_cast<unsigned char>(c)) ? c : '_'; // one for a letter
        auto* type = new ddsi_sertype{};
        ddsi_sertype_init(type, ("skin_calib_msgs::msg::dds_::" + message + "_").c_str(), &type_operations,
                          &sample_operations, true);
        type->allowed_data_representation = DDS_DATA_REPRESENTATION_FLAG_XCDR1;
        dds_qos_t* quality = dds_create_qos();
        dds_qset_reliability(quality, DDS_RELIABILITY_RELIABLE, DDS_MSECS(2)); // for which it waits for a slow reader
        dds_qset_durability(quality, durability);
        dds_qset_history(quality, DDS_HISTORY_KEEP_LAST, depth);
        const dds_entity_t made =
            dds_create_topic_sertype(participant_, (name + "/" + topic).c_str(), &type, quality, nullptr, nullptr);
        const dds_entity_t entity = made < 0 ? made : dds_create_writer(participant_, made, quality, nullptr);
        dds_delete_qos(quality);
        return {entity, type};
    }

    dds_entity_t domain_ = 0, participant_ = 0;
};

} // namespace dds
