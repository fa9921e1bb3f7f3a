// The loop of "skin-calib run" in C++: packets of readings in over UDP, a SkinFrame for each of them out.
//
//     run CALIBRATION NOISE INPUT_PORT OUTPUT_PORT|dds
//
// Both ports are of 127.0.0.1. The page "Packets" of the documentation has the format of what comes in. What goes out
// are the bytes of ROS 2 (CDR): over UDP alone, or over DDS with the latched layout, where ROS 2 receives them. Ctrl+C
// and SIGTERM end the loop; then it prints what it has counted.
#include <arpa/inet.h>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <sched.h>
#include <sys/socket.h>
#include <unistd.h>

#include "skin_calib_json.hpp"
#ifdef SKIN_CALIB_DDS
#include "dds.hpp"
#endif

using namespace skin_calib;

namespace {

std::uint32_t crc32(const std::uint8_t* bytes, std::size_t size) {
    static const auto table = [] {
        std::array<std::uint32_t, 256> made{};
        for (std::uint32_t k = 0; k < 256; ++k) {
            made[k] = k;
            for (int bit = 0; bit < 8; ++bit) made[k] = made[k] >> 1 ^ (made[k] & 1 ? 0xEDB88320u : 0u);
        }
        return made;
    }();
    std::uint32_t crc = ~0u;
    for (std::size_t k = 0; k < size; ++k) crc = crc >> 8 ^ table[(crc ^ bytes[k]) & 255];
    return ~crc;
}

std::uint64_t number(const std::uint8_t* bytes, int size) {
    std::uint64_t value = 0;
    for (int k = 0; k < size; ++k) value |= std::uint64_t{bytes[k]} << 8 * k;
    return value;
}

// Check packets, and count what is wrong. See skin_calib_addon/messages/packet.py.
struct Decoder {
    static constexpr std::size_t start = 28; // bytes before the readings
    static constexpr std::uint32_t half = 1u << 31;
    static constexpr int old_in_a_row = 100;

    std::uint64_t received = 0, lost = 0, old = 0, damaged = 0, skipped = 0, restarts = 0, cycle = 0;
    double time = 0;
    std::vector<std::uint16_t> values;

    // Take a datagram; return whether it is a new reading.
    bool take(const std::uint8_t* bytes, std::size_t size) {
        if (size < start || std::memcmp(bytes, "SKIN", 4) != 0 || crc32(bytes, 24) != number(bytes + 24, 4)) {
            skipped += size;
            return false;
        }
        const unsigned version = bytes[4], bits = bytes[5];
        const std::size_t channels = number(bytes + 6, 2), end = start + (channels * bits + 7) / 8;
        const bool is_known = version == 1 && (bits == 8 || bits == 12 || bits == 16) &&
                              number(bytes + 16, 8) / 1000000 < half; // what the stamp of a message can have
        if (!is_known || size != end + 4 || crc32(bytes, end) != number(bytes + end, 4)) {
            ++damaged;
            return false;
        }
        if (!is_next(static_cast<std::uint32_t>(number(bytes + 8, 4)),
                     static_cast<std::uint32_t>(number(bytes + 12, 4))))
            return false;
        time = static_cast<double>(number(bytes + 16, 8)) / 1e6;
        values.resize(channels);
        const std::uint8_t* body = bytes + start;
        for (std::size_t k = 0; k < channels; ++k) {
            const std::uint8_t* at = body + k * bits / 8;
            const unsigned word = bits == 8 ? at[0] : at[0] | unsigned{at[1]} << 8;
            values[k] = static_cast<std::uint16_t>(bits != 12 ? word : k % 2 ? word >> 4 : word & 4095);
        }
        return true;
    }

private:
    bool is_next(std::uint32_t session, std::uint32_t number) {
        if (!has_last_) {
            has_last_ = true;
        } else if (session != session_) {
            ++restarts, ++cycle;
        } else {
            std::uint32_t step = number - last_;
            if (step == 0 || step >= half) {
                const std::uint32_t later = number - old_;
                olds_ = later > 0 && later < half ? olds_ + 1 : 1, old_ = number;
                if (olds_ < old_in_a_row) return ++old, false;
                ++restarts, step = 1;
            }
            lost += step - 1, cycle += step;
        }
        session_ = session, last_ = number, olds_ = 0;
        ++received;
        return true;
    }

    bool has_last_ = false;
    std::uint32_t session_ = 0, last_ = 0, old_ = 0;
    int olds_ = 0;
};

// Write values as CDR, little-endian: each number at a multiple of its size after the header.
class Cdr {
public:
    std::vector<std::uint8_t> bytes;

    void clear() { bytes.assign({0, 1, 0, 0}); }

    template <class Number> Cdr& operator<<(Number value) {
        while ((bytes.size() - 4) % sizeof(Number) != 0) bytes.push_back(0);
        const auto* raw = reinterpret_cast<const std::uint8_t*>(&value);
        bytes.insert(bytes.end(), raw, raw + sizeof value);
        return *this;
    }
    Cdr& operator<<(bool value) { return *this << static_cast<std::uint8_t>(value); }
    Cdr& operator<<(const std::string& text) {
        *this << static_cast<std::uint32_t>(text.size() + 1);
        bytes.insert(bytes.end(), text.c_str(), text.c_str() + text.size() + 1);
        return *this;
    }
    template <std::size_t n> Cdr& operator<<(const std::array<double, n>& values) {
        for (double x : values) *this << x;
        return *this;
    }
    template <class Range> Cdr& sequence(const Range& values) {
        *this << static_cast<std::uint32_t>(values.size());
        for (const auto& x : values) *this << x;
        return *this;
    }
};

template <std::size_t n> std::array<double, n> or_nan(const std::optional<std::array<double, n>>& values) {
    std::array<double, n> unknown;
    unknown.fill(not_a_number);
    return values.value_or(unknown);
}

void write(Cdr& out, const Polygon& polygon, std::optional<double> probability) {
    for (std::size_t axis = 0; axis < 2; ++axis) {
        Numbers along;
        for (const Vec2& corner : polygon.corners) along.push_back(corner[axis]);
        out.sequence(along);
    }
    out << probability.value_or(not_a_number);
}

// Begin a message with its header. The definitions are in skin_calib_addon/messages/skin_calib_msgs/msg.
void begin(Cdr& out, const std::string& link, double time) {
    const double whole = std::floor(time);
    const auto nanoseconds = static_cast<std::int64_t>(whole) * 1000000000 + std::llround((time - whole) * 1e9);
    out.clear();
    out << static_cast<std::int32_t>(nanoseconds / 1000000000) << static_cast<std::uint32_t>(nanoseconds % 1000000000);
    out << link;
}

// Write a TaxelLayout.
void write(Cdr& out, const Skin& skin, double time) {
    const Calibration& c = skin.geometry.calibration;
    begin(out, c.link, time);
    out << std::int32_t{1} << c.checksum << false;
    out.sequence(c.ids).sequence(Rows(c.channels.begin(), c.channels.end()));
    out.sequence(c.positions).sequence(c.normals).sequence(c.tangents).sequence(c.areas);
    for (std::size_t axis = 0; axis < 3; ++axis) {
        Numbers sigma;
        for (const Vec3& of_one : c.sigma) sigma.push_back(of_one[axis]);
        out.sequence(sigma);
    }
    const Plane none{{}, {}};
    const Plane& plane = skin.ground ? skin.ground->plane : none;
    out.sequence(skin.thresholds()) << skin.ground.has_value() << plane.origin << plane.axes[0] << plane.axes[2];
}

// Write a SkinFrame.
void write(Cdr& out, const Skin& skin, const Frame& frame, std::uint64_t cycle, std::uint64_t lost) {
    const Calibration& calibration = skin.geometry.calibration;
    begin(out, calibration.link, frame.time);
    out << cycle << lost << calibration.checksum;
    const Trusted trusted = frame.trusted();
    out << static_cast<bool>(trusted) << trusted.touched << trusted.wrench << trusted.point << trusted.guaranteed;
    std::vector<std::string> flags;
    for (unsigned k = 0; k < std::size(flag::names); ++k)
        if (frame.flags & 1u << k) flags.emplace_back(flag::names[k]);
    std::sort(flags.begin(), flags.end());
    out.sequence(flags);
    out << std::string(frame.is_known && !frame.is_lost ? "" : text(frame.reason));
    out << frame.touched().value_or(false) << frame.touched().has_value();
    out << static_cast<std::uint32_t>(frame.contacts.size());
    for (const Contact& contact : frame.contacts) {
        out << contact.number;
        out.sequence(Rows(frame.rows.begin() + static_cast<std::ptrdiff_t>(contact.begin),
                          frame.rows.begin() + static_cast<std::ptrdiff_t>(contact.end)));
        out << contact.force << contact.area << contact.peak_pressure;
        out << contact.position << contact.normal << contact.wrench;
    }
    out << frame.wrench << or_nan(frame.wrench_sigma) << frame.stands();
    out << std::string(frame.stands() ? "" : text(frame.reason));
    out << frame.load << frame.load_sigma.value_or(not_a_number);
    out << or_nan(frame.cop) << or_nan(frame.cop_sigma) << or_nan(frame.zmp) << or_nan(frame.zmp_sigma);
    write(out, frame.polygon.outer, frame.polygon.outer_probability);
    write(out, frame.polygon.nominal, std::nullopt);
    write(out, frame.polygon.guaranteed, frame.polygon.guaranteed_probability);
    Numbers forces(frame.forces);
    for (std::size_t i = 0; i < forces.size(); ++i)
        if (!frame.known[i]) forces[i] = not_a_number;
    out.sequence(forces);
    out << std::uint32_t{0}; // quantities of other modalities
}

volatile std::sig_atomic_t is_stopped = 0;

sockaddr_in local(const char* port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(std::atoi(port)));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK); // INADDR_ANY: also from other computers
    return address;
}

} // namespace

int main(int count, char** words) {
    const bool is_dds = count == 5 && std::strcmp(words[4], "dds") == 0;
    if (count != 5 || std::atoi(words[3]) <= 0 || (!is_dds && std::atoi(words[4]) <= 0))
        return std::fprintf(stderr, "run CALIBRATION NOISE INPUT_PORT OUTPUT_PORT|dds\n"), 2;
    Skin skin;
    const Status status = load(words[1], words[2], {}, skin);
    if (!status.ok) return std::fprintf(stderr, "%s\n", status.message.c_str()), 1;
    const int socket = ::socket(AF_INET, SOCK_DGRAM, 0), buffer = 1 << 22;
    const timeval wait{0, 100000};
    const sockaddr_in input = local(words[3]), output = local(words[4]);
    setsockopt(socket, SOL_SOCKET, SO_RCVBUF, &buffer, sizeof buffer);
    setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof wait);
    if (bind(socket, reinterpret_cast<const sockaddr*>(&input), sizeof input) != 0) return std::perror("bind"), 1;
    for (int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { is_stopped = 1; });
    const sched_param priority{50};
    const bool is_real_time = sched_setscheduler(0, SCHED_FIFO, &priority) == 0;
#ifdef SKIN_CALIB_DDS
    dds::Output readers; // after the priority, which its threads inherit
    const std::string problem = is_dds ? readers.open(skin.geometry.calibration.link) : "";
#else
    const std::string problem = is_dds ? "no DDS: Cyclone DDS 0.10 was not found when this was compiled" : "";
#endif
    if (!problem.empty()) return std::fprintf(stderr, "%s\n", problem.c_str()), 1;
    std::fprintf(stderr, "%s priority\n", is_real_time ? "real-time" : "normal");

    std::vector<std::uint8_t> bytes(65536);
    Decoder decoder;
    Cdr out;
    std::uint64_t unsent = 0;
    const auto send = [&](bool is_frame) {
#ifdef SKIN_CALIB_DDS
        if (is_dds) return (is_frame ? readers.frame : readers.layout).send(out.bytes);
#endif
        return !is_frame || sendto(socket, out.bytes.data(), out.bytes.size(), 0,
                                   reinterpret_cast<const sockaddr*>(&output), sizeof output) >= 0;
    };
    std::optional<bool> knows_noise; // as the last layout says
    while (!is_stopped) {
        const ssize_t size = recv(socket, bytes.data(), bytes.size(), 0);
        if (size < 0 || !decoder.take(bytes.data(), static_cast<std::size_t>(size))) continue;
        const Frame& frame = skin.update(decoder.values.data(), decoder.values.size(), decoder.time);
        if (knows_noise != skin.noise().has_value()) { // the layout has its thresholds
            knows_noise = skin.noise().has_value();
            write(out, skin, decoder.time);
            unsent += !send(false);
        }
        write(out, skin, frame, decoder.cycle, decoder.lost);
        unsent += !send(true);
    }
    const auto print = [](const char* name, std::uint64_t n) {
        std::printf("%s %llu\n", name, static_cast<unsigned long long>(n));
    };
    print("received", decoder.received), print("lost", decoder.lost), print("old", decoder.old);
    print("damaged", decoder.damaged), print("skipped", decoder.skipped), print("restarts", decoder.restarts);
    print("unsent", unsent);
    close(socket);
}
